"""Signs that a mesh is not in the ship frame, and the transform that would put it there.

A ship is long, symmetric from side to side, and sparse at the top: areas of its cross-sections
identify the three axes. Thresholds are relative to the size of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ncti.ships.transform import Transform

Floats = NDArray[np.float64]

SECTIONS = 64  # along each axis
MIN_ASYMMETRY = 0.3  # of the vertical axis; six ships: 0.96, their other axes 0.2
MAX_HEIGHT_RATIO = 2.0  # height of an upright ship over its length and its beam
MIN_LENGTH_RATIO = 1.1  # by which y must be longer than x to be the length
MAX_CENTRE_HEIGHT = 0.55  # of the centre of volume of an upright ship, over its height
MIN_BOTTOM_RATIO = 0.5  # length of the lowest sections of an upright ship over the highest
MIN_BOW_RATIO = 1.3  # of sections at both ends, from which the finer end is taken as the bow
MAX_ORIGIN_OFFSET = 0.25  # of the origin from the middle, over length or beam
MAX_DRY_SHARE = 0.005  # height of the lowest point above the water, over the height, by rounding
MIN_LIFT = 0.005  # least height [m] reported, as offsets are rounded to 0.01 m
MAX_KEEL_RATIO = 0.75  # area of the lowest section over that of one higher, where it is a keel
DRAUGHT_RATIO = 1 / 3  # draught over beam, where it is not known

LOW_SECTIONS, HIGH_SECTIONS = (0.03, 0.06, 0.1), (0.9, 0.94, 0.97)  # of the height
BOTTOM_SECTION, NEXT_SECTION = 0.005, 0.08  # of the height
END_SHARE = 0.1  # of the length


@dataclass(frozen=True)
class Diagnosis:
    """Signs that a mesh is not in the ship frame, as verb phrases, and a remedy for all."""

    findings: tuple[str, ...] = ()
    suggested_transform: Transform | None = None


def diagnose(vertices: Floats, faces: NDArray[np.integer]) -> Diagnosis:
    """Return signs that a mesh is not in the ship frame.

    `vertices` (vertex, 3) [m] include those below the waterline; `faces` (facet, 3) are of a closed
    mesh. The vertical axis is the one along which areas of sections are least symmetric; its upper
    end has short sections. The longer of the two others is the length, and the bow its finer end,
    which is a guess. A box is equally symmetric along all axes, so only its extents count.

    Not detected: a bow that points aft, a mirror image, a ship on its side that is as
    symmetric along its height, and a flat-bottomed hull that stands on its keel.
    """
    if not len(vertices) or not (np.ptp(vertices, axis=0) > 0).all():
        return Diagnosis()
    turn, findings = _find_rotation(vertices, faces)
    shift, origin_findings = _find_offset(turn.apply(vertices), faces, turn.up)
    findings += origin_findings
    if not findings:
        return Diagnosis()
    offset = [round(value, 2) for value in shift]
    return Diagnosis(tuple(findings), Transform(up=turn.up, forward=turn.forward, offset=offset))


def _find_rotation(vertices: Floats, faces: NDArray[np.integer]) -> tuple[Transform, list[str]]:
    """Return the rotation to ship axes, and findings on the axes of the mesh."""
    extent = np.ptp(vertices, axis=0)
    areas = [section_areas(vertices, faces, axis) for axis in range(3)]
    vertical, along = _vertical_and_length(extent, [_asymmetry(area) for area in areas])
    down = _is_upside_down(vertices, faces, vertical, along, areas[vertical])
    if (vertical, along, down) == (2, 0, False):
        return Transform(), []
    end = max(1, round(END_SHARE * SECTIONS))
    first, last = (float(areas[along][ends].mean()) for ends in (slice(end), slice(-end, None)))
    # If both ends are alike, the bow is taken at the positive end.
    backward = last > MIN_BOW_RATIO * first
    up, forward = (
        ("-" if negative else "") + "xyz"[axis]
        for axis, negative in ((vertical, down), (along, backward))
    )
    if vertical != 2:
        finding = "stands on end" if along == 2 else "lies on its side"
    elif down:
        finding = "is upside down"
    else:
        finding = "has its length along y"
    return Transform(up=up, forward=forward), [finding]


def _vertical_and_length(extent: Floats, asymmetry: list[float]) -> tuple[int, int]:
    """Return the vertical and the longitudinal axis: z and x unless the shape excludes them."""
    odd = int(np.argmax(asymmetry))
    vertical = 2
    # The length of a hull may be as asymmetric, but its height is never its longest extent.
    if odd != int(np.argmax(extent)) and asymmetry[odd] > max(MIN_ASYMMETRY, 2 * asymmetry[2]):
        vertical = odd
    elif extent[2] > MAX_HEIGHT_RATIO * max(extent[0], extent[1]):
        vertical = 0 if extent[0] < extent[1] else 1
    if vertical == 2:
        return 2, 1 if extent[1] > MIN_LENGTH_RATIO * extent[0] else 0
    first, second = (axis for axis in range(3) if axis != vertical)
    return vertical, first if extent[first] >= extent[second] else second


def _is_upside_down(
    vertices: Floats, faces: NDArray[np.integer], vertical: int, along: int, areas: Floats
) -> bool:
    """Return whether the short and light end of the vertical axis is the lower one."""
    middles = (np.arange(SECTIONS) + 0.5) / SECTIONS
    if float(middles @ areas) <= MAX_CENTRE_HEIGHT * float(areas.sum()):
        return False
    low, high = (
        max(_section_length(vertices, faces, vertical, along, height) for height in heights)
        for heights in (LOW_SECTIONS, HIGH_SECTIONS)
    )
    return low < MIN_BOTTOM_RATIO * high


def _find_offset(vertices: Floats, faces: NDArray[np.integer], up: str) -> tuple[Floats, list[str]]:
    """Return the offset [m] to the ship's origin, and findings on the origin of the mesh.

    Vertices are in ship axes, and `up` is the axis of the mesh that points up there.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    (length, beam, height), middle = high - low, (low + high) / 2
    shift, findings = np.zeros(3), []
    if abs(middle[0]) > MAX_ORIGIN_OFFSET * length:
        shift[0] = -middle[0]
        findings.append(f"has its origin {_distance(middle[0])} from amidships")
    if abs(middle[1]) > MAX_ORIGIN_OFFSET * beam:
        shift[1] = -middle[1]
        findings.append(f"has its origin {_distance(middle[1])} off its centreline")
    if high[2] <= 0 or low[2] > max(MAX_DRY_SHARE * height, MIN_LIFT):
        shift[2] = -low[2]
        findings += _height_finding(low[2], high[2], up)
    if low[2] + shift[2] >= -MAX_DRY_SHARE * height and _has_keel(vertices, faces):
        shift[2] -= min(DRAUGHT_RATIO * beam, height / 2)
        findings.append("has its waterline at its keel (draught taken as a third of the beam)")
    return shift, findings


def _height_finding(low: float, high: float, up: str) -> list[str]:
    """Return the finding on a mesh whose ends in ship axes are both above z = 0, or both below.

    It describes the mesh as given: an upside-down mesh floats above the water where the upright
    ship would be under it.
    """
    if up[-1] != "z":
        return []  # the z axis of the mesh is not vertical
    if up == "-z":
        low, high = -high, -low
    if high <= 0:
        return ["lies wholly under water"]
    return [f"floats {_distance(low)} above the water"] if low > MIN_LIFT else []


def _distance(metres: float) -> str:
    """Return a distance as text, in centimetres if it is short."""
    size = abs(metres)
    return f"{size:.1f} m" if size >= 0.95 else f"{100 * size:.0f} cm"


def _has_keel(vertices: Floats, faces: NDArray[np.integer]) -> bool:
    """Return whether the lowest section is much smaller than one above, as at a keel."""
    low, above = section_areas(vertices, faces, 2, places=np.array([BOTTOM_SECTION, NEXT_SECTION]))
    return bool(low < MAX_KEEL_RATIO * above)


def _asymmetry(areas: Floats) -> float:
    """Return the share of volume that would have to move to make both ends alike, 0 to 1."""
    total = float(areas.sum())
    return float(np.abs(areas - areas[::-1]).sum()) / (2 * total) if total > 0 else 0.0


def section_areas(
    vertices: Floats,
    faces: NDArray[np.integer],
    axis: int,
    *,
    places: Floats | None = None,
) -> Floats:
    """Return the areas (section,) of sections of a closed mesh across one of its axes [m2].

    `vertices` (vertex, 3) [m], `faces` (facet, 3); `places` (section,) are shares of the extent,
    `SECTIONS` evenly spaced ones by default. The surface beyond a section and the section itself
    are closed, so the area is the sum of normal components along the axis over all facets beyond
    it. A facet that the section cuts counts by the share of its extent beyond: exact for a facet
    along the axis or across it, and for the mean over all sections that cut it to the order of its
    size.
    """
    if places is None:
        places = (np.arange(SECTIONS) + 0.5) / SECTIONS
    corners = vertices[faces]
    edges = corners[:, 1:] - corners[:, :1]
    first, other = (k for k in range(3) if k != axis)
    normal = (edges[:, 0, first] * edges[:, 1, other] - edges[:, 0, other] * edges[:, 1, first]) / 2
    normal *= -1.0 if axis == 1 else 1.0  # x cross z is -y
    along = corners[:, :, axis]
    low, high = along.min(axis=1), along.max(axis=1)
    start, extent = float(vertices[:, axis].min()), float(np.ptp(vertices[:, axis]))
    cuts = start + extent * places
    level = high - low <= 1e-6 * extent
    area = _sum_beyond(high[level], normal[level], cuts)
    # Shares beyond a cut are ramps from `low` to `high`: differences of two ramps without end.
    slope = normal[~level] / (high - low)[~level]
    for ends, sign in ((high, 1.0), (low, -1.0)):
        place = ends[~level] - start
        area += sign * _sum_beyond(ends[~level], slope * place, cuts)
        area -= sign * _sum_beyond(ends[~level], slope, cuts) * (cuts - start)
    return np.maximum(area, 0.0)


def _sum_beyond(places: Floats, weights: Floats, cuts: Floats) -> Floats:
    """Return for each of the ascending cuts the sum of weights at places beyond it."""
    number = np.searchsorted(cuts, places, side="left")
    inside = np.bincount(number, weights, len(cuts) + 1).astype(np.float64)
    return np.cumsum(inside[::-1])[::-1][1:]


def _section_length(
    vertices: Floats, faces: NDArray[np.integer], axis: int, along: int, place: float
) -> float:
    """Return the extent [m] along one axis of the section across another, at a share of it."""
    heights = vertices[:, axis]
    cut = float(heights.min()) + place * float(np.ptp(heights))
    ends = np.concatenate([faces, np.roll(faces, -1, axis=1)]).reshape(2, -1)
    low, high = heights[ends] - cut
    crossing = (low > 0) != (high > 0)
    if not crossing.any():
        return 0.0
    share = low[crossing] / (low - high)[crossing]
    first, second = vertices[ends[:, crossing], along]
    return float(np.ptp(first + share * (second - first)))
