"""What a configuration may hold, and the checks it passes before any work starts.

The YAML files of `conf/` extend these dataclasses through Hydra's ConfigStore, so that a key
that does not exist, or a word where a number is meant, is refused while the configuration is
composed. Ranges are checked in `__post_init__`, which runs when `SweepConfig` is made from the
composed configuration. Below that, no code sees a DictConfig.
"""

from __future__ import annotations

from dataclasses import dataclass, field, is_dataclass
from typing import Any, get_type_hints

import numpy as np
from hydra.core.config_store import ConfigStore
from numpy.typing import NDArray
from omegaconf import MISSING

from ncti.features import SEGMENTATION_METHODS
from ncti.features.log_polar import INTERPOLATIONS
from ncti.infrared import (
    CONTRAST_AT_ZERO,
    EXTINCTION,
    IFOV,
    NEDT,
    SPREAD,
    SUPER_RESOLUTIONS,
)
from ncti.ladar import RECEIVERS, shortest_pulse
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
    InfraredGrid,
    between,
    count_axis,
    number_axis,
    one_of,
    ship_axis,
    ship_label,
    word_axis,
)

MOST_DRAWN = 10_000  # target-free IFOVs a frame where no short cut stands in for them

RANGE, INFRARED, IRAR = "range", "infrared", "irar"
SENSORS = {RANGE: (RANGE,), INFRARED: (INFRARED,), "both": (RANGE, INFRARED), IRAR: (IRAR,)}

# Of one frame [K]. What the most frames and the recombination of shifted ones leave of it,
# 0.5 / sqrt(10,000), is still no less than the 1e-6 K that matched segmentation can tell from 0.
LEAST_NEDT = 1e-3
MOST_FRAMES = 10_000

# Patches of ship are counted, so a pixel that the ship fills may come out a patch or so short of
# 1, by chance: a rule above this share would drop such pixels at random.
MOST_COVERAGE = 0.95


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
class LadarConfig:
    """The laser radar: its beam, its receiver, its noise."""

    ifov: float = 150.0
    bin_width: float = 1.0
    window: float = 250.0
    spread: float = 0.5
    reflectance: str = "projected_area"
    cnr: float = 32.0
    cnr_range: float = 100.0
    extinction: float = 0.0
    target_free_ifovs: Any = 4000
    receiver: str = "full_profile"
    false_alarm: float = 1e-6

    def __post_init__(self) -> None:
        """Check the ranges."""
        between("ladar.ifov", self.ifov, 1, 100e3)
        between("ladar.bin_width", self.bin_width, 0.05, 50)
        between("ladar.window", self.window, 20, 5000)
        if self.window < 10 * self.bin_width:
            raise ConfigurationError(
                f"ladar.window is {self.window:g} m, but must hold at least 10 bins of "
                f"ladar.bin_width {self.bin_width:g} m"
            )
        between("ladar.spread", self.spread, 0, 1)
        one_of("ladar.reflectance", self.reflectance, ("projected_area", "lambertian"))
        between("ladar.cnr", self.cnr, -100, 100)
        between("ladar.cnr_range", self.cnr_range, 1, 1000)
        between("ladar.extinction", self.extinction, 0, 10)
        one_of("ladar.receiver", self.receiver, RECEIVERS)
        between("ladar.false_alarm", self.false_alarm, 1e-12, 0.5)
        floors = self.floor_axis()
        if self.receiver != "full_profile" and max(floors) > MOST_DRAWN:
            raise ConfigurationError(
                f"ladar.target_free_ifovs has {max(floors)}, but must be at most {MOST_DRAWN} with "
                f"the {self.receiver} receiver, which needs each of them drawn"
            )

    def floor_axis(self) -> tuple[int, ...]:
        """Every value of `target_free_ifovs`, checked."""
        return count_axis(
            "ladar.target_free_ifovs", self.target_free_ifovs, minimum=0, maximum=10**7
        )


@dataclass
class InfraredConfig:
    """The passive-infrared imager: its array, the air, the scene, and what is made of an image."""

    ifov: float = IFOV * 1e6
    contrast_at_zero: float = CONTRAST_AT_ZERO
    extinction: float = EXTINCTION * 1e3
    nedt: float = NEDT
    target_spread: float = SPREAD
    sea_spread: float = SPREAD
    false_alarm: float = 1e-6
    window_length: float = 200.0
    window_height: float = 50.0
    range: Any = None
    frame_count: Any = None
    super_resolution: Any = field(default_factory=lambda: list(SUPER_RESOLUTIONS))
    coverage_rule: Any = 0.25
    segmentation: Any = "matched"
    inner_radius: Any = 0.5
    interpolation: Any = "nearest"
    training_range: float = 25.0
    vigilance: Any = None
    phases: int = 4
    orders: int = 4

    def __post_init__(self) -> None:
        """Check the ranges of what is no axis."""
        between("infrared.ifov", self.ifov, 1, 100e3)
        between("infrared.contrast_at_zero", self.contrast_at_zero, 0, 1000)
        between("infrared.extinction", self.extinction, 0, 10)
        between("infrared.nedt", self.nedt, LEAST_NEDT, 1000)
        between("infrared.target_spread", self.target_spread, 0, 1000)
        between("infrared.sea_spread", self.sea_spread, 0, 1000)
        between("infrared.false_alarm", self.false_alarm, 1e-12, 0.5)
        between("infrared.window_length", self.window_length, 1, 5000)
        between("infrared.window_height", self.window_height, 1, 500)
        between("infrared.training_range", self.training_range, 1, 1000)
        between("infrared.phases", self.phases, 1, 1000)
        between("infrared.orders", self.orders, 1, 1000)

    def expand(self, grid: Grid) -> InfraredGrid:
        """Every value of every axis, checked; what is not given here is the grid's."""
        key = "infrared."
        return InfraredGrid(
            range=grid.range
            if self.range is None
            else number_axis(key + "range", self.range, minimum=1, maximum=1000),
            super_resolution=word_axis(
                key + "super_resolution", self.super_resolution, SUPER_RESOLUTIONS
            ),
            frame_count=grid.frame_count
            if self.frame_count is None
            else count_axis(key + "frame_count", self.frame_count, maximum=MOST_FRAMES),
            coverage_rule=number_axis(
                key + "coverage_rule", self.coverage_rule, minimum=0.01, maximum=MOST_COVERAGE
            ),
            segmentation=word_axis(key + "segmentation", self.segmentation, SEGMENTATION_METHODS),
            inner_radius=number_axis(
                key + "inner_radius", self.inner_radius, minimum=0.01, maximum=2
            ),
            interpolation=word_axis(key + "interpolation", self.interpolation, INTERPOLATIONS),
            phase=tuple(range(self.phases)),
            order=tuple(range(self.orders)),
            vigilance=grid.vigilance
            if self.vigilance is None
            else number_axis(key + "vigilance", self.vigilance, minimum=0, maximum=1),
        )


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
