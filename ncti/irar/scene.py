"""Returns of the ship to every sample of a scan, before noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require_all, require_shape
from ncti.irar.flight import Flight
from ncti.render import RayHits, cast_rays

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]

RAYS = 5
"""Rays along each side of an IFOV."""

MARGIN = 3.0
"""Pixels of sea around the ship that a scan includes."""

MAX_LINES = 20_000
"""Largest number of lines of a pass: thirty times those of a flight at the article's overscan."""

LINES_AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class Returns:
    """Returns of the ship to each sample of a scan, or to each pixel of a snapshot.

    `shape` is lines and columns; `place` (hit,) the flat index of a ray's sample, ascending; `ray`
    (hit,) its number, below `rays`; `distance` (hit,) [m]; `power` (hit,) is relative to a flat
    target that fills the IFOV.
    """

    shape: tuple[int, int]
    place: NDArray[np.intp]
    ray: NDArray[np.intp]
    distance: Floats
    power: Floats
    rays: int

    def coverage(self) -> Floats:
        """Return the fraction of the IFOV that the ship fills, (line, column)."""
        count = np.bincount(self.place, minlength=math.prod(self.shape))
        return count.reshape(self.shape) / self.rays

    def drop_leading(self, columns: int) -> Returns:
        """Return the returns without the first columns."""
        line, column = np.divmod(self.place, self.shape[1])
        inside = column >= columns
        width = self.shape[1] - columns
        place = line[inside] * width + column[inside] - columns
        rest = {name: getattr(self, name)[inside] for name in ("ray", "distance", "power")}
        return replace(self, shape=(self.shape[0], width), place=place, **rest)


@dataclass(frozen=True)
class ScanPlan:
    """Lines that a pass needs to scan a ship from its waterline to its mast tops.

    `flight` has its pointing set. Line 0 begins at time 0; the plan has `lines` lines from line
    `first` on.
    """

    flight: Flight
    first: int
    lines: int

    def time(self, columns: NDArray[np.integer]) -> Floats:
        """Return the time of each sample after the snapshot, (line, column) [s]."""
        line = self.first + np.arange(self.lines)
        return line[:, None] / self.flight.line_rate + columns / self.flight.pulse_rate

    def meets(self, mesh: trimesh.Trimesh) -> bool:
        """Return whether the lines are long and aimed well enough to hit part of a ship."""
        corners = np.asarray(mesh.vertices, dtype=np.float64)
        _, along, _ = _find_crossings(self.flight, corners, name="pointing")
        half = self.flight.samples * self.flight.ifov / 2
        return bool(along.min() < half and along.max() > -half)


def plan_scan(mesh: trimesh.Trimesh, flight: Flight) -> ScanPlan:
    """Return the lines and the pointing with which a pass scans a whole ship.

    A flight whose `pointing` is set keeps it, whether or not the ship fits into the line.
    """
    corners = np.asarray(mesh.vertices, dtype=np.float64)
    _, up, away = flight.snapshot_axes @ corners.T
    if 2 * np.abs(away).max() > flight.range_gate:
        raise ValueError(
            f"range_gate is {flight.range_gate:g} m, but must be at least "
            f"{math.ceil(2 * np.abs(away).max())}, as deep as this ship about its origin"
        )
    # Lines climb by sin(depression) times the distance that the aircraft approaches.
    closer = float(up.max()) / math.sin(math.radians(flight.depression))
    closer = max(closer, 0.0) + float(np.ptp(away)) / 2
    if closer > flight.slant_range / 2:
        raise ValueError(
            f"slant_range is {flight.slant_range:g} m, but must be at least "
            f"{math.ceil(2 * closer)} m, twice the distance that the aircraft approaches"
        )
    # Times at which lines meet the ship's corners, with a margin.
    aimed = flight if flight.pointing is not None else _aim_scan(flight, corners)
    name = "offset" if flight.pointing is None else "pointing"
    times, along, climb_rate = _find_crossings(aimed, corners, name=name)
    margin = MARGIN * flight.ifov + 4 * flight.jitter
    reach = margin / climb_rate.min() + flight.samples / flight.pulse_rate
    start, stop = float(times.min()) - reach, float(times.max()) + reach
    if (stop - start) * flight.line_rate > MAX_LINES:
        raise ValueError(
            f"line_rate is {flight.line_rate:g}, but must be at most "
            f"{MAX_LINES / (stop - start):.3g}, for {MAX_LINES} lines in this pass"
        )
    samples = math.ceil(2 * (float(np.abs(along).max()) + margin) / flight.ifov)
    if flight.pointing is None and samples > flight.samples:
        raise ValueError(
            f"samples is {flight.samples}, but must be at least {samples} for this ship and its "
            "drift across the scan"
        )
    first, last = math.floor(start * flight.line_rate), math.ceil(stop * flight.line_rate)
    return ScanPlan(aimed, first, last - first + 1)


def _find_crossings(flight: Flight, corners: Floats, *, name: str) -> tuple[Floats, Floats, Floats]:
    """Return time [s], scan angle [rad] and rate [rad/s] at which endless lines cross corners."""
    step = 1e-3
    climb_rate = np.full(len(corners), flight.climb / flight.slant_range)
    time = np.zeros(len(corners))
    for _ in range(20):  # Newton's method, on nearly straight lines
        along, across = flight.angles_to(corners, time)
        climb_rate = (across - flight.angles_to(corners, time + step)[1]) / step
        # A ship that drifts across lines tilted by the mirror may move away as fast as they climb.
        if not (climb_rate > 0.1 * flight.climb / flight.slant_range).all():
            raise ValueError(
                f"{name} is {getattr(flight, name):g}, but must be nearer "
                f"{0 if name == 'offset' else flight.offset:g}: the lines, which the mirror tilts, "
                f"do not climb a ship that drifts across them at {flight.drift:g} m/s"
            )
        change = across / climb_rate
        time = time + change
        if np.abs(change).max() < 1e-6:
            break
    return time, along, climb_rate


def _aim_scan(flight: Flight, corners: Floats) -> Flight:
    """Return the flight with its scan centred on the passage of the ship's middle."""
    pointing = [flight.offset, flight.offset + 0.1]
    middles: list[float] = []
    for _ in range(8):
        aimed = replace(flight, pointing=pointing[len(middles)])
        _, along, _ = _find_crossings(aimed, corners, name="offset")
        middles.append(float(along.min() + along.max()) / 2)
        if abs(middles[-1]) < flight.ifov / 10:
            break
        if len(middles) > 1:  # secant method, on a nearly straight line
            slope = (pointing[-1] - pointing[-2]) / (middles[-1] - middles[-2])
            pointing.append(pointing[-1] - middles[-1] * slope)
    return aimed


def brightness_of(
    mesh: trimesh.Trimesh, reflectivity: Floats | None, *, lambertian: bool
) -> Callable[[RayHits], Floats]:
    """Return the function from hits of rays to (hit,) powers, relative to a flat target."""
    facets = np.ones(len(mesh.faces)) if reflectivity is None else reflectivity
    facets = require_all("reflectivity", facets, minimum=0)
    require_shape("reflectivity", facets, (len(mesh.faces),))
    return lambda hits: facets[hits.facet] * (hits.cosine if lambertian else 1.0)


def scan_scene(
    mesh: trimesh.Trimesh,
    plan: ScanPlan,
    *,
    leading: int = 0,
    attitude: Floats | None = None,
    reflectivity: Floats | None = None,
    lambertian: bool = False,
) -> Returns:
    """Return the ship's returns to each sample, by casting rays along the scan.

    `leading` columns before the first sample serve trailing passive detectors; `attitude` (line, 2)
    [rad] are errors of the line of sight, right and up; `reflectivity` (facet,) is relative to the
    flat target of the carrier-to-noise ratio, 1 by default. Power follows the projected area, as in
    the article, or if `lambertian` also the cosine of incidence.
    """
    brightness = brightness_of(mesh, reflectivity, lambertian=lambertian)
    flight = plan.flight
    columns = np.arange(-leading, flight.samples)
    ray_offset = (np.arange(RAYS) - (RAYS - 1) / 2) / RAYS * flight.ifov
    time = plan.time(columns)
    blocks = []
    errors = np.zeros((plan.lines, 2)) if attitude is None else attitude
    radius = float(np.linalg.norm(mesh.extents)) / 2
    for start in range(0, plan.lines, LINES_AT_ONCE):
        line = slice(start, min(start + LINES_AT_ONCE, plan.lines))
        along = np.broadcast_to(flight.scan_angles(columns), time[line].shape)
        along = along + errors[line, :1]
        origin = flight.position(time[line])
        # Skip samples whose middle misses the ship's bounding sphere: they see the sea.
        across = np.broadcast_to(errors[line, 1:], along.shape)
        middle = flight.directions(along, across)
        to_ship = mesh.bounds.mean(axis=0) - origin
        separation = np.linalg.norm(to_ship, axis=-1)
        reach = np.arcsin(np.minimum(radius / separation, 1.0)) + flight.ifov
        ahead = np.einsum("...i,...i->...", to_ship, middle)
        near = np.nonzero(ahead > separation * np.cos(reach))
        if not len(near[0]):
            continue
        # A grid of rays over the IFOV of each remaining sample.
        right = along[near][:, None, None] + ray_offset
        above = across[near][:, None, None] + ray_offset[:, None]
        right, above = np.broadcast_arrays(right, above)
        ways = flight.directions(right, above).reshape(-1, 3)
        starts = np.repeat(origin[near], RAYS**2, axis=0)
        hits = cast_rays(mesh, starts, ways)
        sample, ray = np.divmod(hits.ray, RAYS**2)
        place = (near[0][sample] + start) * len(columns) + near[1][sample]
        blocks.append((place, ray, hits.distance, brightness(hits)))
    nothing = [(np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0), np.empty(0))]
    place, ray, distance, power = map(np.concatenate, zip(*(blocks or nothing), strict=True))
    return Returns((plan.lines, len(columns)), place, ray, distance, power / RAYS**2, RAYS**2)
