"""A scan of the field of regard: the imager detects, the laser radar visits and identifies.

Ships of the grid and a decoy lie in it at random, at aspects that no template has.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import infrared, ladar, search
from ncti.ladar import RangeExtent
from ncti.search import Box, Field
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices, Settings, count, number, word
from sweeps.engine.stage import Output, Stage, plain, stage
from sweeps.stages import views
from sweeps.stages.infrared import Infrared
from sweeps.stages.ladar import Arrays, Ladar, profile_bins
from sweeps.stages.views import SCAN, STATUS, Grid, Render, Scene, looks, quantity

if TYPE_CHECKING:
    import trimesh

SENSOR = GROUP = SCAN
NOWHERE = -1  # of a detection: no target, but the sea
BARGE, NO_DECOY = "barge", "none"
DECOY = "decoy"  # name of the last target


class Scan(Settings, key="scan"):
    """The search of the field of regard.

    The source gives both fields (12 x 12 deg of the imager, 2 x 3 deg of the laser radar), the
    IFOV and the 2 x 2 detector. Rates, the imager's array and the decoy are assumptions.
    """

    width = quantity(3, 0.1, 60, "degree", "width of the field of regard")
    height = quantity(2, 0.1, 60, "degree", "height of the field of regard")
    detector = count(2, 1, 64, label="elements of the laser radar along a side of its detector")
    pulse_rate = quantity(
        *(1000, 1, 1e9, "Hz", "pulses of the laser radar a second, one a frame"),
        help="at most that of an unambiguous range",
    )
    imager_pixels = count(256, 1, 10**5, label="pixels along a side of the imager's array")
    imager_frames = count(16, 1, 10**4, label="frames averaged by the imager")
    frame_rate = quantity(30, 0.01, 1e6, "Hz", "frames of the imager a second")
    slew_time = quantity(0.1, 0, 100, "s", "time of a move to a visit, or of the imager's array")
    depth = number(0.05, 0, 0.5, label="share of the range by which targets are nearer or farther")
    decoy = word(
        BARGE,
        (BARGE, NO_DECOY),
        label="what lies among the ships",
        help="barge: a box as warm as they are",
    )
    decoy_length = quantity(120, 1, 1000, "m", "length of the decoy")
    decoy_beam = quantity(20, 1, 1000, "m", "beam of the decoy")
    decoy_height = quantity(8, 0.1, 100, "m", "height of the decoy above the sea")
    known_views = count(
        24, 1, 10**4, label="views a ship from which the least similarity of a ship is learned"
    )
    lost = number(0.05, 0, 0.99, label="share of known ships that the least similarity turns away")


of_scan = partial(
    stage, uses=(Scan, Grid, Render, Ladar, Infrared), when=looks(SCAN), status=STATUS
)

VIEW = (
    Output("true_aspect", dtype="f8"),
    Output("offset", dtype="f8"),  # of bearing, -1 to 1 of what its slot leaves
    Output("slant_range", dtype="f8"),
    Output("fraction", ("ifov", "down_range")),  # of as many IFOVs as any ship has, empty ones too
    Output("cell", ("ifov", "side"), "i4"),
)


@dataclass(frozen=True, eq=False)
class Target:
    """A ship or decoy in the field, from the arrays of `VIEW`."""

    aspect: float  # [deg]
    offset: float
    extent: RangeExtent

    @classmethod
    def of(cls, found: Arrays, ifov: float, bin_width: float, window: float) -> Target:
        """Return a target of some arrays, IFOVs without it left out; of an IFOV [rad]."""
        seen = found["fraction"].any(axis=1)
        extent = RangeExtent(
            fraction=found["fraction"][seen].astype(np.float64),
            down_range=profile_bins(window, bin_width),
            bin_width=bin_width,
            cell=found["cell"][seen].astype(np.int64),
            ifov=ifov,
            slant_range=float(found["slant_range"]),
        )
        return cls(float(found["true_aspect"]), float(found["offset"]), extent)

    def shown(self, rule: float) -> NDArray[np.int64]:
        """(pixel, 2): pixels that show it, from its origin, of which it fills at least a share."""
        return self.extent.cell[self.extent.fraction.sum(axis=1) >= rule]

    def inside(self, box: Box) -> RangeExtent:
        """Return what is seen of it by the IFOVs of a box, which counts from its origin."""
        held = box.holds(self.extent.cell)
        parts = {"fraction": self.extent.fraction[held], "cell": self.extent.cell[held]}
        return RangeExtent(**{**vars(self.extent), **parts, "difference": None})


@plain(uses=(Scan, Grid, Ladar, Infrared))
def scan_reach(
    range: float, depth: float, ifov: float, window_length: float, window_height: float
) -> tuple[int, int]:
    """Return by how many IFOVs, across and up, parts of the largest ship are apart at most."""
    side = ifov * 1e-6 * range * 1e3 * (1 - depth)
    return math.ceil(window_length / side), math.ceil(window_height / side)


def view_of(
    mesh: trimesh.Trimesh,
    rng: np.random.Generator,
    aspects: tuple[float, ...],
    *,
    depth: float,
    slant_range: float,
    depression: float,
    most: tuple[int, int],
    drawn: tuple[Any, ...],
    binned: dict[str, Any],
) -> Arrays:
    """Return the arrays of `VIEW`: what is seen of a ship at a random aspect and place.

    Its aspect is anywhere between the first and the last that are learned. Its IFOVs differ by
    `most` columns and rows.
    """
    aspect = float(rng.uniform(min(aspects), max(aspects)))
    offset, deep = rng.uniform(-1, 1, 2).tolist()
    far = slant_range * (1 + depth * deep)
    down = math.radians(depression)
    up = search.elevation(far, middle_range=slant_range, depression=down) if down else 0.0
    engine, pixel, samples, roll = drawn
    image = views.image(mesh, aspect, math.degrees(down - up), engine, pixel, samples, roll, ())
    extent = ladar.range_extent(image, slant_range=far, **binned)
    empty = (most[0] + 1) * (most[1] + 1) - len(extent.cell)
    return {
        "true_aspect": np.array(aspect),
        "offset": np.array(offset),
        "slant_range": np.array(far),
        "fraction": np.pad(extent.fraction, ((0, empty), (0, 0))).astype(np.float32),
        "cell": np.pad(extent.cell, ((0, empty), (0, 0))),
    }


def binned(ifov: float, bin_width: float, window: float, spread: float) -> dict[str, Any]:
    """Return how range extents are binned: keywords of `ncti.ladar.range_extent`."""
    return {"ifov": ifov * 1e-6, "bin_width": bin_width, "window": window, "spread": spread}


@of_scan(*VIEW, gather=(Grid.aspect,), stream=(Grid.ship, Grid.replicate))
def scan_target(
    mesh: trimesh.Trimesh,
    aspect: tuple[float, ...],
    range: float,
    scan_reach: tuple[int, int],
    depression: float,
    depth: float,
    drawing_engine: str,
    pixel: float,
    samples: int,
    roll: float,
    ifov: float,
    bin_width: float,
    window: float,
    spread: float,
    rng: np.random.Generator,
) -> Arrays:
    """Return what is seen of a ship of the field: the same aspects and places at every range."""
    return view_of(
        mesh,
        rng,
        aspect,
        depth=depth,
        slant_range=range * 1e3,
        depression=depression,
        most=scan_reach,
        drawn=(drawing_engine, pixel, samples, roll),
        binned=binned(ifov, bin_width, window, spread),
    )


@of_scan(*VIEW, gather=(Grid.aspect,), stream=(Grid.replicate,))
def scan_decoy(
    decoy: str,
    decoy_length: float,
    decoy_beam: float,
    decoy_height: float,
    aspect: tuple[float, ...],
    range: float,
    scan_reach: tuple[int, int],
    depression: float,
    depth: float,
    drawing_engine: str,
    pixel: float,
    samples: int,
    roll: float,
    ifov: float,
    bin_width: float,
    window: float,
    spread: float,
    rng: np.random.Generator,
) -> Arrays:
    """Return what is seen of the decoy; nothing of none."""
    found = view_of(
        box(decoy_length, decoy_beam, decoy_height),
        rng,
        aspect,
        depth=depth,
        slant_range=range * 1e3,
        depression=depression,
        most=scan_reach,
        drawn=(drawing_engine, pixel, samples, roll),
        binned=binned(ifov, bin_width, window, spread),
    )
    if decoy == NO_DECOY:
        found["fraction"][:] = 0
    return found


@lru_cache(maxsize=4)
def box(length: float, beam: float, height: float) -> trimesh.Trimesh:
    """Return a box that floats, its origin amidships on the waterline."""
    import trimesh  # takes long

    found = trimesh.creation.box(extents=(length, beam, height))
    found.apply_translation((0.0, 0.0, height / 2))
    return found


# What the imager detects


@plain(uses=(Scan, Ladar))
def scan_field(width: float, height: float, ifov: float) -> tuple[float, float, float]:
    """Return the field's sides and its IFOV [rad]."""
    return math.radians(width), math.radians(height), ifov * 1e-6


@of_scan(
    Output("column", ("target",), "i4", label="column of a target's origin in the field"),
    Output("row", ("target",), "i4", label="row of a target's origin in the field"),
    Output("true_aspect", ("target",), "f4", label="aspect of a target", unit="degree"),
    Output("slant_range", ("target",), "f4", label="slant range of a target", unit="m"),
    Output("shown", ("target",), "i4", label="pixels that show a target"),
    Output("hot", ("target",), "i4", label="pixels of a target above the threshold"),
    Output("chance", ("target",), "f4", label="probability that one of them is, in closed form"),
    Output("alarms", dtype="i4", label="pixels of the sea above the threshold"),
    Output("source", ("detection",), "i4", pad=-2, fill=-2, label="target detected; -1 the sea"),
    Output("box", ("detection", "edge"), "i4", pad=-1, label="left, bottom, right, top of a detection"),
    Output("visit", ("detection", "edge"), "i4", pad=-1, label="left, bottom, right, top of its visit"),
    reads={"extinction": Infrared.extinction, "false_alarm": Infrared.false_alarm},
    group=GROUP,
    gather=(Grid.ship,),
    stream=(Grid.range, Grid.replicate),
)
def scan_detected(
    scan_target: Arrays,
    scan_decoy: Arrays,
    scan_field: tuple[float, float, float],
    scan_reach: tuple[int, int],
    range: float,
    depression: float,
    detector: int,
    bin_width: float,
    window: float,
    imager_frames: int,
    coverage_rule: float,
    contrast_at_zero: float,
    extinction: float,
    nedt: float,
    target_spread: float,
    sea_spread: float,
    false_alarm: float,
    window_length: float,
    rng: np.random.Generator,
) -> Arrays:
    """Return where targets lie, which of them are detected, and what is to be visited.

    Each has a slot of bearings of its own, in random order, and as much sea between it and the
    next that no ship reaches across.
    """
    field = Field(width=scan_field[0], height=scan_field[1], ifov=scan_field[2])
    targets = targets_of(scan_target, scan_decoy, field.ifov, bin_width, window)
    slot = field.width / len(targets)
    free = slot / 2 - room(range, window_length)
    order = rng.permutation(len(targets))
    place, shown, contrasts, chances = [], [], [], []
    sigma = {
        name: float(infrared.pixel_sigma(spread, frame_count=imager_frames, nedt=nedt))
        for name, spread in (("target_sigma", target_spread), ("sea_sigma", sea_spread))
    }
    for turn, target in zip(order.tolist(), targets, strict=True):
        far = target.extent.slant_range
        down = math.radians(depression)
        up = search.elevation(far, middle_range=range * 1e3, depression=down) if down else 0.0
        bearing = (turn + 0.5) * slot - field.width / 2 + free * target.offset
        place.append(field.pixel(bearing, up))
        shown.append(target.shown(coverage_rule) + place[-1])
        contrast = infrared.contrast(
            far, contrast_at_zero=contrast_at_zero, extinction=extinction * 1e-3
        )
        contrasts.append(contrast)
        chances.append(
            infrared.detection_probability(
                len(shown[-1]), contrast=contrast, false_alarm=false_alarm, **sigma
            )
        )
    image = search.thermal_field(
        field,
        shown,
        contrasts,
        frame_count=imager_frames,
        rng=rng,
        nedt=nedt,
        target_spread=target_spread,
        sea_spread=sea_spread,
    )
    threshold = infrared.detection_threshold(false_alarm=false_alarm, sigma=sigma["sea_sigma"])
    found = search.detect(image, threshold=threshold, reach=scan_reach)
    owner = np.full(field.shape, NOWHERE)
    for turn, pixel in enumerate(shown):
        owner[pixel[:, 1], pixel[:, 0]] = turn
    owners = [owner[one.pixel[:, 1], one.pixel[:, 0]] for one in found]
    hot = np.bincount(np.concatenate([[], *owners]).astype(int) + 1, minlength=len(targets) + 1)
    boxes = [one.box for one in found]
    visits = [search.cue(one, reach=scan_reach, detector=detector) for one in boxes]
    return {
        "column": np.array([column for column, _ in place]),
        "row": np.array([row for _, row in place]),
        "true_aspect": np.array([target.aspect for target in targets]),
        "slant_range": np.array([target.extent.slant_range for target in targets]),
        "shown": np.array([len(pixel) for pixel in shown]),
        "hot": hot[1:],
        "chance": np.array(chances),
        "alarms": hot[0],
        "source": np.array([source_of(one, len(targets)) for one in owners], dtype=int),
        "box": np.array(boxes, dtype=int).reshape(-1, 4),
        "visit": np.array(visits, dtype=int).reshape(-1, 4),
    }


def room(slant_range: float, window_length: float) -> float:
    """Return the half width of a slot that a target and the sea beside it need [rad]."""
    return window_length / (slant_range * 1e3)


def source_of(owners: NDArray[np.integer], targets: int) -> int:
    """Return the target with the most pixels of a detection; the sea only if there is none."""
    pixels = np.bincount(owners[owners >= 0], minlength=targets)
    return int(pixels.argmax()) if pixels.any() else NOWHERE


def targets_of(
    ships: Arrays, decoy: Arrays, ifov: float, bin_width: float, window: float
) -> list[Target]:
    """Return the ships of the field, and the decoy behind them if there is one."""
    several = [{name: ships[name][k] for name in ships} for k in range(len(ships["fraction"]))]
    if decoy["fraction"].any():
        several.append(decoy)
    return [Target.of(one, ifov, bin_width, window) for one in several]


@of_scan(
    Output("target", ("target",), "U64", label="what lies in the field"),
    group=GROUP,
    gather=(Grid.ship,),
    coordinates=True,
    status="",
)
def scan_names(ship: tuple[str, ...], decoy: str) -> NDArray[np.str_]:
    """Return the names of all targets."""
    return np.array([*map(str, ship), *([DECOY] if decoy != NO_DECOY else [])])


@of_scan(
    Output("edge", ("edge",), "U8", label="side of a box of pixels, the last two behind it"),
    group=GROUP,
    coordinates=True,
    status="",
)
def scan_edges() -> NDArray[np.str_]:
    """Return the names of a box's edges."""
    return np.array(Box._fields)


def check(choices: Choices) -> Choices:
    """Refuse (`ConfigurationError`) fields, ranges and rates that cannot be searched."""
    if not looks(SENSOR)(choices):
        return choices
    _check_field(choices)
    apertures = {*choices[Ladar.ifov], *choices[Infrared.ifov]}
    if len(apertures) > 1:
        raise ConfigurationError(
            f"infrared.ifov has {max(choices[Infrared.ifov]):g}, but must be one number and that "
            f"of ladar.ifov with the sensor {SENSOR}: both sensors look through one aperture"
        )
    tolerance = next((one for one in choices[Render.tolerance] if one is not None), None)
    if tolerance is not None:
        raise ConfigurationError(
            f"render.tolerance has {tolerance:g}, but must be null with the sensor {SENSOR}"
        )
    far = max(choices[Grid.range]) * 1e3 * (1 + max(choices[Scan.depth]))
    most, given = search.most_pulses(far), max(choices[Scan.pulse_rate])
    if given > most:
        raise ConfigurationError(
            f"scan.pulse_rate has {given:g}, but must be at most {most:.0f} Hz for pulses to be "
            f"back from {far * 1e-3:g} km before the next ones leave"
        )
    for where in choices[Grid.range]:
        narrowest = min(choices[Ladar.ifov]) * (1 - max(choices[Scan.depth]))
        views.check_range(choices, "grid.range", where, narrowest=narrowest, beam="ladar.ifov")
    return choices


def _check_field(choices: Choices) -> None:
    """Refuse a field that does not hold its targets one beside the other."""
    targets = len(choices[Grid.ship]) + (BARGE in choices[Scan.decoy])
    width, longest = min(choices[Scan.width]), choices.one(Infrared.window_length)
    nearest = 2 * room(1.0, longest) * targets / math.radians(width)
    for where in choices[Grid.range]:
        if where < nearest:
            raise ConfigurationError(
                f"grid.range has {where:g}, but must be at least {nearest:.3g} km for "
                f"{targets} targets to lie side by side in a field of {width:g} deg"
            )
    # On a flat sea the nearest target is lowest in the field.
    deep, height = max(choices[Scan.depth]), min(choices[Scan.height])
    for where in choices[Grid.range]:
        for depression in depressions(choices, where):
            steep = math.sin(math.radians(depression)) / (1 - deep)
            low = math.degrees(math.asin(steep)) - depression if steep < 1 else math.inf
            if low > height / 2:
                raise ConfigurationError(
                    f"scan.depth has {deep:g}, but must be less for targets at {where:g} km to "
                    f"lie in a field of {height:g} deg"
                )


def depressions(choices: Choices, slant_range: float) -> set[float]:
    """Return the depressions [deg] of the field's middle, in every geometry."""
    scenes = (Scene.geometry, Scene.depression, Scene.altitude, Scene.earth_radius)
    several = product(*(choices[one] for one in scenes))
    return {views.depression(slant_range, *scene) for scene in several}


SETTINGS: tuple[type[Settings], ...] = (Scan,)
STAGES: tuple[Stage, ...] = (
    *(scan_reach, scan_field, scan_target, scan_decoy, scan_detected),
    *(scan_names, scan_edges),
)
