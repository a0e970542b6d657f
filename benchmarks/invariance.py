"""Change of the log-polar map by shift, scale and rotation of a silhouette."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import ncti.ships
from benchmarks.reports import Column, Report, Sample
from benchmarks.views import DEPRESSION
from ncti.features import cyclic_similarity, log_polar
from ncti.render import range_image

ASPECTS = tuple(float(aspect) for aspect in range(0, 91, 15))  # [deg]
POINT = 0.125  # pixel of the range images that silhouettes are made from [m]
SEED = 1
NEAREST, BILINEAR = "nearest", "bilinear"


@dataclass(frozen=True)
class Pixels:
    """Sampling of a silhouette by pixels.

    Attributes
    ----------
    name : str
        In the table.
    side : float
        Of a pixel [m].
    least : float, optional
        Share of a pixel that the ship must cover for the pixel to be full; without it, the
        mask holds the shares themselves.
    """

    name: str
    side: float
    least: float | None = None

    def mask(self, coverage: NDArray[np.float64]) -> NDArray[np.float64] | NDArray[np.bool_]:
        """Mask of area coverage."""
        return coverage if self.least is None else coverage >= self.least


FINE = Pixels("1 m, coverage", 1.0)
FINE_BINARY = Pixels("1 m, half covered", 1.0, 0.5)
SENSOR = Pixels("3.75 m, a quarter", 3.75, 0.25)  # 25 km at 150 microradians
PIXELS = (FINE, FINE_BINARY, SENSOR)


@dataclass(frozen=True)
class Change:
    """Transform of a silhouette before it is mapped again.

    Attributes
    ----------
    shift : (float, float)
        Along columns and rows [pixel].
    scale : float
        Factor of size.
    angle : float
        Rotation from columns towards rows [deg].
    """

    shift: tuple[float, float] = (0.0, 0.0)
    scale: float = 1.0
    angle: float = 0.0

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Change:
        """Any part of a pixel, 0.5 to 2 times the size, any angle."""
        column, row = rng.uniform(0.0, 1.0, size=2).tolist()
        return cls((column, row), float(2 ** rng.uniform(-1, 1)), float(rng.uniform(0, 360)))


SHIFT, SCALE, ANGLE = "shift", "scale 0.5–2", "angle, as it is"
ANGLE_BEST, ALL_BEST = "angle, best rotation", "all, best rotation"
"""Changes in the table, and how the maps before and after are compared."""

COLUMNS = (
    Column("mask", "mask"),
    Column("change", "change"),
    Column(NEAREST, "plain (nearest)", ".3f"),
    Column(BILINEAR, "bilinear, 2 x 2", ".3f"),
)


def measure(
    *,
    repeats: int,
    ships: Sequence[str] | None = None,
    aspects: Sequence[float] = ASPECTS,
) -> Report:
    """Cosine between the log-polar maps of a silhouette before and after a change.

    Parameters
    ----------
    repeats : int
        Random changes of every view.
    ships : sequence of str, optional
        Names or paths; all ships without.
    aspects : sequence of float
        Views [deg].

    Returns
    -------
    Report
        One row for each mask and change, one column for each map.

    Notes
    -----
    All masks and maps see the same changes. A map is compared as it is, or, after a rotation,
    at the best cyclic shift in angle.
    """
    names = ncti.ships.names() if ships is None else tuple(ships)
    rng = np.random.default_rng(SEED)
    found: dict[tuple[str, str], dict[str, list[float]]] = {}
    for name in names:
        for aspect in aspects:
            points = silhouette(name, aspect)
            changes = [Change.drawn(rng) for _ in range(repeats)]
            for pixels in PIXELS:
                for kind in (NEAREST, BILINEAR):
                    for change in changes:
                        for row, value in _cosines(points, pixels, kind, change).items():
                            kinds = found.setdefault((pixels.name, row), {})
                            kinds.setdefault(kind, []).append(value)
    rows = [
        {"mask": mask, "change": row} | {kind: Sample.of(values) for kind, values in kinds.items()}
        for (mask, row), kinds in found.items()
    ]
    return Report(
        f"Invariance of the log-polar map, cosines: {len(names)} ships, {len(aspects)} aspects, "
        f"changed {repeats} times at random",
        COLUMNS,
        rows,
        [
            "Median (lowest–highest) over views and changes, against the same view in place; "
            "shifts are parts of a pixel, for whole pixels change nothing. 3.75 m is a pixel at "
            "25 km.",
            "Coverage: the mask holds shares of pixels. Otherwise a pixel is full when the ship "
            "covers half or a quarter of it, so that thin masts may vanish.",
        ],
    )


def silhouette(ship: str, aspect: float) -> NDArray[np.float64]:
    """Points of a ship's silhouette.

    Parameters
    ----------
    ship : str
        Name or path.
    aspect : float
        View [deg].

    Returns
    -------
    (2, point) float64 ndarray
        Horizontal and vertical [m]; each point stands for POINT x POINT of area.
    """
    image = range_image(
        ncti.ships.load(ship), aspect=aspect, depression=DEPRESSION, pixel=POINT, engine="auto"
    )
    return np.stack(image.cross_range_at(*np.nonzero(image.hit)))


def coverage(
    points: NDArray[np.float64], *, side: float, change: Change | None = None
) -> NDArray[np.float64]:
    """Share of each pixel that a silhouette covers.

    Parameters
    ----------
    points : (2, point) float64 ndarray
        As `silhouette` gives them [m].
    side : float
        Of a pixel [m].
    change : Change, optional
        Transform of the silhouette about the ship's origin.

    Returns
    -------
    (row, col) float64 ndarray
        In [0, 1], cropped to the silhouette; rows grow upwards.
    """
    change = change or Change()
    cos, sin = np.cos(np.radians(change.angle)), np.sin(np.radians(change.angle))
    turned = np.array([[cos, -sin], [sin, cos]]) @ points
    place = turned * (change.scale / side) + np.array(change.shift)[:, None]
    column, row = np.floor(place).astype(np.intp)
    column -= column.min()
    row -= row.min()
    columns, rows = int(column.max()) + 1, int(row.max()) + 1
    count = np.bincount(row * columns + column, minlength=rows * columns)
    # A lattice of points may put one too many into a full pixel.
    return np.minimum(count.reshape(rows, columns) * (change.scale * POINT / side) ** 2, 1.0)


def cosine(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Cosine of two maps as they are; 0 if either is all zero."""
    norms = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.vdot(a, b)) / norms if norms else 0.0


def _cosines(
    points: NDArray[np.float64], pixels: Pixels, kind: str, change: Change
) -> dict[str, float]:
    """Return cosines of the maps before and after each part of a change, and all of it."""

    def map_after(change: Change) -> NDArray[np.float64]:
        mask = pixels.mask(coverage(points, side=pixels.side, change=change))
        return log_polar(mask, interpolation=kind)

    before = map_after(Change())
    turned = map_after(Change(angle=change.angle))
    return {
        SHIFT: cosine(map_after(Change(shift=change.shift)), before),
        SCALE: cosine(map_after(Change(scale=change.scale)), before),
        ANGLE: cosine(turned, before),
        ANGLE_BEST: float(cyclic_similarity(turned, before)[0]),
        ALL_BEST: float(cyclic_similarity(map_after(change), before)[0]),
    }
