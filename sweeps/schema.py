"""What a configuration may hold, and the checks it passes before any work starts.

The YAML files of `conf/` extend these dataclasses through Hydra's ConfigStore, so that a key
that does not exist, or a word where a number is meant, is refused while the configuration is
composed. Ranges are checked in `__post_init__`, which runs when `SweepConfig` is made from the
composed configuration. Below that, no code sees a DictConfig.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, is_dataclass
from typing import Any, get_type_hints

import numpy as np
from hydra.core.config_store import ConfigStore
from numpy.typing import NDArray
from omegaconf import MISSING

from ncti.ladar import shortest_pulse
from ncti.render import ROLL, engines
from sweeps.axes import OF_SILHOUETTES
from sweeps.classifier_schema import (
    ACN,
    FUSION,
    NOISY,
    WITH_LEFT_OUT,
    WITH_MOMENTS,
    WITH_NOISE,
    ClassifierConfig,
)
from sweeps.errors import ConfigurationError
from sweeps.flight_schema import OF_MEASURED, FlightConfig, check_learning
from sweeps.grid import (
    Grid,
    between,
    count_axis,
    number_axis,
    one_of,
    ship_axis,
    ship_label,
)
from sweeps.sensor_schema import MOST_FRAMES, InfraredConfig, LadarConfig

RANGE, INFRARED, IRAR = "range", "infrared", "irar"
SENSORS = {RANGE: (RANGE,), INFRARED: (INFRARED,), "both": (RANGE, INFRARED), IRAR: (IRAR,)}

UNREAD = {  # what the sensors make no use of, and what they use in its place
    RANGE: {"infrared": "", "irar": ""},
    INFRARED: {"ladar": "", "irar": "", "grid.pulse_width": ""},
    "both": {"irar": ""},
    IRAR: {
        **{"infrared": "", "scene": "irar.depression"},
        **{"grid.range": "irar.range", "grid.frame_count": "irar.profile_frames"},
    },
}


@dataclass
class GridConfig:
    """Axes: each one value, a list, or (for numbers) a mapping of start, stop and step."""

    ship: Any = MISSING
    aspect: Any = MISSING
    pulse_width: Any = MISSING
    frame_count: Any = MISSING
    range: Any = MISSING
    vigilance: Any = MISSING
    replicate: int = 1

    def expand(self) -> Grid:
        """Every value of every axis, checked."""
        return Grid(
            ship=ship_axis("grid.ship", self.ship),
            aspect=number_axis("grid.aspect", self.aspect, minimum=0, below=360),
            pulse_width=number_axis("grid.pulse_width", self.pulse_width, minimum=1, maximum=1000),
            frame_count=count_axis("grid.frame_count", self.frame_count, maximum=MOST_FRAMES),
            range=number_axis("grid.range", self.range, minimum=1, maximum=1000),
            vigilance=number_axis("grid.vigilance", self.vigilance, minimum=0, maximum=1),
            replicate=tuple(range(self.replicate)),
        )

    def __post_init__(self) -> None:
        """Check what is no axis of its own values."""
        between("grid.replicate", self.replicate, 1, 1000)


@dataclass
class SceneConfig:
    """Where the aircraft is: one depression for every range, or one altitude."""

    geometry: str = "fixed"
    depression: float = 3.84
    altitude: float = 6705.6
    earth_radius: float = 6371e3

    def __post_init__(self) -> None:
        """Check the ranges."""
        one_of("scene.geometry", self.geometry, ("fixed", "altitude"))
        between("scene.depression", self.depression, 0, 90)
        between("scene.altitude", self.altitude, 1, 50e3)
        between("scene.earth_radius", self.earth_radius, 1e6, 1e12)


@dataclass
class RenderConfig:
    """How range images are drawn."""

    engine: str = "auto"
    pixel: float = 0.25
    samples: int = 20_000
    roll: float = ROLL

    def __post_init__(self) -> None:
        """Check the ranges."""
        one_of("render.engine", self.engine, ("auto", *engines()))
        between("render.pixel", self.pixel, 0.01, 5)
        between("render.samples", self.samples, 0, 10**7)
        between("render.roll", self.roll, -180, 180)


@dataclass
class ClusterConfig:
    """Who does the work."""

    kind: str = "local"
    workers: int | None = None

    def __post_init__(self) -> None:
        """Check the ranges."""
        one_of("cluster.kind", self.kind, ("local", "inline"))
        if self.workers is not None:
            between("cluster.workers", self.workers, 1, 4096)


@dataclass
class SweepConfig:
    """Everything a sweep is told."""

    sensor: str = RANGE
    grid: GridConfig = field(default_factory=GridConfig)
    scene: SceneConfig = field(default_factory=SceneConfig)
    render: RenderConfig = field(default_factory=RenderConfig)
    ladar: LadarConfig = field(default_factory=LadarConfig)
    infrared: InfraredConfig = field(default_factory=InfraredConfig)
    irar: FlightConfig = field(default_factory=FlightConfig)
    classifier: ClassifierConfig = field(default_factory=ClassifierConfig)
    cluster: ClusterConfig = field(default_factory=ClusterConfig)
    seed: int = 0
    store: str | None = None
    cache: str | None = None

    def __post_init__(self) -> None:
        """Check what several groups decide together."""
        one_of("sensor", self.sensor, tuple(SENSORS))
        between("seed", self.seed, 0, 2**63)
        for key in ("store", "cache"):
            if getattr(self, key) == "":
                raise ConfigurationError(f"{key} is empty, but must be a path")
        grid = self.grid.expand()
        self.infrared.expand(grid)
        # Settings of a classifier that names nothing are left alone: experiments are shared, and
        # one of their classifiers may be asked for.
        of_profiles = set(self.classifiers if RANGE in self.sensors else ())
        axes = self.classifier.expand()
        if of_profiles & set(WITH_NOISE) and NOISY in axes.training and self.grid.replicate < 2:
            raise ConfigurationError(
                f"grid.replicate is {self.grid.replicate}, but must be at least 2 where "
                "classifier.training has noisy: what is learned must not be what is tested"
            )
        taught = self.learned().any(axis=0).sum()
        if of_profiles & set(WITH_LEFT_OUT) and any(axes.left_out) and taught < 2:
            raise ConfigurationError(
                f"classifier.left_out has True, but must be false where {taught} aspect is "
                "learned: nothing would be left"
            )
        for name in sorted(of_profiles & set(WITH_MOMENTS)):
            if self.ladar.receiver != "full_profile":
                raise ConfigurationError(
                    f"ladar.receiver is {self.ladar.receiver!r}, but must be full_profile for the "
                    f"classifier {name}, which knows the moments of no other"
                )
        if FUSION in self.classifiers:
            self._check_fusion(grid)
        labels = tuple(ship_label(name) for name in grid.ship)
        self.irar.flies(labels)
        self.irar.expand()
        if IRAR in self.sensors:
            self.irar.check(grid.aspect)
            check_learning(self.classifier, self.ladar.floor_axis())
        shortest = shortest_pulse(self.ladar.bin_width) * 1e9
        if self.sensor != INFRARED and min(grid.pulse_width) < shortest:
            raise ConfigurationError(
                f"grid.pulse_width has {min(grid.pulse_width):g}, but must be at least "
                f"{shortest:.3g} for ladar.bin_width {self.ladar.bin_width:g} m"
            )

    @property
    def classifiers(self) -> tuple[str, ...]:
        """Who names the ships: fusion, among others, only where both sensors see every range.

        Measured profiles are named without moments, which nobody knows.
        """
        names = self.classifier.expand().name
        if names == (FUSION,):
            return names
        if self.sensor == IRAR:
            return tuple(name for name in names if name in OF_MEASURED)
        grid = self.grid.expand()
        shared = set(grid.range) <= set(self.infrared.expand(grid).range)
        together = self.sensor == "both" and shared
        return tuple(name for name in names if name != FUSION or together)

    def _check_fusion(self, grid: Grid) -> None:
        """Refuse what one sensor would see and the other would not."""
        if self.sensor != "both":
            raise ConfigurationError(
                f"sensor is {self.sensor!r}, but must be both for the classifier fusion"
            )
        there = self.infrared.expand(grid).range
        for slant_range in grid.range:
            if slant_range not in there:
                raise ConfigurationError(
                    f"grid.range has {slant_range:g}, but every value must be one of "
                    f"{', '.join(f'{one:g}' for one in there)}, the values of infrared.range, for "
                    "the classifier fusion"
                )
        if self.infrared.phases < 2:
            raise ConfigurationError(
                f"infrared.phases is {self.infrared.phases}, but must be at least 2 for the "
                "classifier fusion, which weighs the silhouettes of one by those of others"
            )
        for name in OF_SILHOUETTES:
            count = len(getattr(self.infrared.expand(grid), name))
            if count > 1:
                raise ConfigurationError(
                    f"infrared.{name} has {count} values, but must have one for the classifier "
                    "fusion"
                )

    @property
    def silent(self) -> tuple[str, ...]:
        """What to say of each classifier that is asked for and has nothing to name."""
        heard = (ACN,) if self.sensor == INFRARED else self.classifiers
        needs = {FUSION: "sensor=both and every value of grid.range among those of infrared.range"}
        return tuple(
            f"classifier.name has {name}, which names nothing here: it needs "
            + needs.get(name, "sensor=range or both")
            for name in self.classifier.expand().name
            if name not in heard
        )

    def learned(self) -> NDArray[np.bool_]:
        """(ship, aspect) bool ndarray: the views that classifiers learn."""
        grid = self.grid.expand()
        labels = tuple(ship_label(name) for name in grid.ship)
        return self.classifier.learned(labels, grid.aspect)

    @property
    def sensors(self) -> tuple[str, ...]:
        """The sensors that look."""
        return SENSORS[self.sensor]


def unread(overrides: Sequence[str], sensor: str) -> list[str]:
    """What to say of keys of a command line that the sensor makes no use of."""
    keys = dict.fromkeys(override.lstrip("+~").partition("=")[0] for override in overrides)
    return [
        f"{key} is set, but is not read where sensor is {sensor}" + (f": {own} is" if own else "")
        for key in keys
        for name, own in UNREAD[sensor].items()
        if key == name or key.startswith(f"{name}.")
    ]


def keys_of(parent: str) -> dict[str, Any]:
    """Keys of a group of the configuration, and their types; of the whole, of an empty name."""
    keys = get_type_hints(SweepConfig)
    for name in filter(None, parent.split(".")):
        schema = keys.get(name)
        keys = get_type_hints(schema) if is_dataclass(schema) else {}
    return keys


def axis_keys() -> tuple[str, ...]:
    """Keys that take one value, a list, or a mapping of start, stop and step."""
    found: list[str] = []
    groups = [name for name, kind in keys_of("").items() if is_dataclass(kind)]
    while groups:
        group = groups.pop(0)
        for key, kind in keys_of(group).items():
            if is_dataclass(kind):
                groups.append(f"{group}.{key}")
            elif kind is Any:
                found.append(f"{group}.{key}")
    return tuple(found)


def unknown_key(key: str) -> str:
    """What to say of a key that the configuration lacks."""
    parent = key.rpartition(".")[0]
    there = ", ".join(keys_of(parent))
    owned = f"; {parent or 'the configuration'} has {there}" if there else ""
    return f"{key} is no key of the configuration{owned}"


def register() -> None:
    """Make the schema known to Hydra under the name that `conf/config.yaml` extends."""
    ConfigStore.instance().store(name="sweep_schema", node=SweepConfig)
