"""Targets of a scan: their views, positions in the field, and detections."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import infrared, search
from ncti.features.profile import EDGE
from ncti.search import Field
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Output, Stage, plain
from sweeps.stages import views
from sweeps.stages.classifier import check_receiver
from sweeps.stages.infrared import Infrared, check_window
from sweeps.stages.ladar import Arrays, Ladar
from sweeps.stages.scan import (
    BARGE,
    GROUP,
    NO_DECOY,
    VIEW,
    Scan,
    of_scan,
    targets_of,
    view_of,
)
from sweeps.stages.scan_tables import NOWHERE
from sweeps.stages.views import SCAN, Grid, Render, Scene, looks

if TYPE_CHECKING:
    import trimesh


@of_scan(*VIEW, gather=(Grid.aspect,), stream=(Grid.ship, Grid.replicate))
def scan_target(
    mesh: trimesh.Trimesh,
    aspect: tuple[float, ...],
    range: float,
    scan_reach: tuple[int, int],
    depression: float,
    depth: float,
    scan_drawn: tuple[Any, ...],
    scan_bins: tuple[float, ...],
    rng: np.random.Generator,
) -> Arrays:
    """Return the view of a ship in the field, at the same aspects and positions for every range."""
    return view_of(
        mesh,
        rng,
        aspect,
        depth=depth,
        slant_range=range * 1e3,
        depression=depression,
        most=scan_reach,
        drawn=scan_drawn,
        bins=scan_bins,
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
    scan_drawn: tuple[Any, ...],
    scan_bins: tuple[float, ...],
    rng: np.random.Generator,
) -> Arrays:
    """Return the view of the decoy, empty if there is none."""
    found = view_of(
        box(decoy_length, decoy_beam, decoy_height),
        rng,
        aspect,
        depth=depth,
        slant_range=range * 1e3,
        depression=depression,
        most=scan_reach,
        drawn=scan_drawn,
        bins=scan_bins,
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


# Detections of the imager


@plain(uses=(Scan, Grid, Ladar, Infrared))
def scan_reach(
    range: float, depth: float, ifov: float, window_length: float, window_height: float
) -> tuple[int, int]:
    """Return the largest extent of a ship across and up [IFOV]."""
    side = ifov * 1e-6 * range * 1e3 * (1 - depth)
    return math.ceil(window_length / side), math.ceil(window_height / side)


@of_scan(
    Output("column", ("target",), "i4", label="column of a target's origin in the field"),
    Output("row", ("target",), "i4", label="row of a target's origin in the field"),
    Output("true_aspect", ("target",), "f4", label="aspect of a target", unit="degree"),
    Output("slant_range", ("target",), "f4", label="slant range of a target", unit="m"),
    Output("shown", ("target",), "i4", label="pixels that show a target"),
    Output("hot", ("target",), "i4", label="pixels of a target above the threshold"),
    Output(
        "chance", ("target",), "f4", label="probability that a target is detected, in closed form"
    ),
    Output("alarms", dtype="i4", label="pixels of the sea above the threshold"),
    Output(
        "source", ("detection",), "i4", pad=-2, fill=-2, label="detected target; -1 for the sea"
    ),
    Output("box", ("detection", "edge"), "i4", pad=-1, label="pixels of a detection"),
    Output(
        "visit", ("detection", "edge"), "i4", pad=-1, label="pixels of the visit to a detection"
    ),
    uses=(Scan, Grid, Ladar, Infrared),
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
    scan_bins: tuple[float, ...],
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
    """Return the positions of targets, their detections, and the pixels to visit.

    Each has a slot of bearings of its own, in random order, and as much sea between it and the
    next that no ship reaches across.
    """
    field = Field(width=scan_field[0], height=scan_field[1], ifov=scan_field[2])
    targets = targets_of(scan_target, scan_decoy, scan_bins)
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
        pixels = target.shown(coverage_rule) + place[-1]
        shown.append(pixels[field.box.holds(pixels)])
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


def check(choices: Choices) -> Choices:
    """Refuse (`ConfigurationError`) fields, ranges and rates that cannot be searched."""
    if not looks(SCAN)(choices):
        return choices
    check_receiver(choices, "likelihood")
    apertures = {*choices[Ladar.ifov], *choices[Infrared.ifov]}
    if len(apertures) > 1:
        raise ConfigurationError(
            f"infrared.ifov has {max(choices[Infrared.ifov]):g}, but must be one number and that "
            f"of ladar.ifov with the sensor {SCAN}: both sensors look through one aperture"
        )
    for setting, allowed in ((Render.tolerance, None), (Ladar.reflectance, "projected_area")):
        for given in choices[setting]:
            if given != allowed:
                raise ConfigurationError(
                    f"{setting.key} has {given}, but must be {allowed or 'null'} with the sensor "
                    f"{SCAN}"
                )
    far = max(choices[Grid.range]) * 1e3 * (1 + max(choices[Scan.depth]))
    most, pulses = search.most_pulses(far), max(choices[Scan.pulse_rate])
    if pulses > most:
        raise ConfigurationError(
            f"scan.pulse_rate has {pulses:g}, but must be at most {most:.0f} Hz for pulses to be "
            f"back from {far * 1e-3:g} km before the next ones leave"
        )
    for ship in choices[Grid.ship]:
        check_window(choices, ship)
    _check_decoy(choices)
    narrowest = min(choices[Ladar.ifov])
    for where in choices[Grid.range]:
        views.check_range(choices, "grid.range", where, narrowest=narrowest, beam="ladar.ifov")
        _check_field(choices, where)
    return choices


def _check_decoy(choices: Choices) -> None:
    """Refuse a decoy that is larger than the largest ship may be."""
    across = math.hypot(max(choices[Scan.decoy_length]), max(choices[Scan.decoy_beam]))
    for setting, found, limit in (
        (Scan.decoy_length, across, Infrared.window_length),
        (Scan.decoy_height, max(choices[Scan.decoy_height]), Infrared.window_height),
        (Scan.decoy_length, across / (1 - 2 * EDGE), Ladar.window),
    ):
        if found > choices.one(limit):
            raise ConfigurationError(
                f"{setting.key} has {max(choices[setting]):g}, but must be less for the decoy to "
                f"be within {limit.key}, {choices.one(limit):g} m"
            )


def _check_field(choices: Choices, where: float) -> None:
    """Refuse a field that does not hold its targets [km] side by side, or is not as high."""
    targets = len(choices[Grid.ship]) + (BARGE in choices[Scan.decoy])
    width, longest = min(choices[Scan.width]), choices.one(Infrared.window_length)
    nearest = 2e-3 * longest * targets / math.radians(width)
    if where < nearest:
        raise ConfigurationError(
            f"grid.range has {where:g}, but must be at least {nearest:.3g} km for {targets} "
            f"targets to lie side by side in a field of {width:g} deg"
        )
    # On a flat sea the nearest target is lowest in the field.
    deep, height = max(choices[Scan.depth]), min(choices[Scan.height])
    for depression in depressions(choices, where):
        steep = math.sin(math.radians(depression)) / (1 - deep)
        low = math.degrees(math.asin(steep)) - depression if steep < 1 else math.inf
        if low > height / 2:
            raise ConfigurationError(
                f"scan.depth has {deep:g}, but must be less for targets at {where:g} km to lie in "
                f"a field {height:g} deg high"
            )


def depressions(choices: Choices, slant_range: float) -> set[float]:
    """Return the depressions [deg] of the field's middle, in every geometry."""
    scenes = (Scene.geometry, Scene.depression, Scene.altitude, Scene.earth_radius)
    several = product(*(choices[one] for one in scenes))
    return {views.depression(slant_range, *scene) for scene in several}


STAGES: tuple[Stage, ...] = (scan_reach, scan_target, scan_decoy, scan_detected)
