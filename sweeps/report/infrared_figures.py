"""Pictures of silhouettes: images and log-polar maps by range."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ncti.features import log_polar, segment
from ncti.infrared import contrast, pixel_sigma
from sweeps.report.axes import nominal
from sweeps.report.rows import setting
from sweeps.report.score_figures import WAYS
from sweeps.report.style import BLUE, HEADING, LABEL, RUST, SMALL, TITLE

# The source's examples: its Figures 6 to 8.
SHIP, ASPECT, FRAMES = "spruance", 60.0, 16

INK, SEA, RING = BLUE, "#e4ecf1", RUST
OUTER_RADIUS: float = inspect.signature(log_polar).parameters["outer_radius"].default
TITLES = ("image above the sea [K]", "silhouette and mapped ring", "log-polar map")
NARROW = 20  # letters of the text beside a row
LABELS = ("across [m]", "across [m]", "angle [°], 0 right, 90 up")


@dataclass(frozen=True)
class Look:
    """One image, with its silhouette and log-polar map.

    The centres of its pixels lie at across (col,) and up (row,) on the target [m]; image (row, col)
    is above the mean of the sea [K], mask (row, col) the silhouette, cells (angle, radius) its map
    as stored; slant_range [km]; way, its super-resolution.
    """

    slant_range: float
    way: str
    across: NDArray[np.float64]
    up: NDArray[np.float64]
    image: NDArray[np.float64]
    mask: NDArray[np.bool_]
    cells: NDArray[np.float64]

    @property
    def pixel(self) -> float:
        """Side of a pixel [m]."""
        return float(self.across[1] - self.across[0])

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top edge [m]."""
        half, across, up = self.pixel / 2, self.across, self.up
        return across[0] - half, across[-1] + half, up[0] - half, up[-1] + half

    @property
    def centroid(self) -> tuple[float, float]:
        """Centroid of the silhouette [m]; NaN if there is none."""
        if not self.mask.any():
            return math.nan, math.nan
        rows, columns = self.mask.nonzero()
        return float(self.across[columns].mean()), float(self.up[rows].mean())

    @property
    def unit(self) -> float:
        """Radius of the disc of the silhouette's area [m]."""
        return self.pixel * math.sqrt(int(self.mask.sum()) / math.pi)

    def show(self, axes: Axes, values: NDArray[Any], colours: Any, ends: Any) -> Any:
        """Draw an image on its pixels, between the ends of a scale."""
        how: Any = {"origin": "lower", "extent": self.extent, "interpolation": "nearest"}
        return axes.imshow(values, cmap=colours, vmin=ends[0], vmax=ends[1], **how)


def looks_of(view: xr.Dataset, configuration: Mapping[str, Any]) -> list[Look]:
    """Return images of a view, segmented as in the sweep, the nearest in one resolution."""
    given = {
        name: setting(view, configuration, name)
        for name in ("contrast_at_zero", "extinction", "nedt", "target_spread", "sea_spread")
    }
    frames = view.frame_count.item()
    looks = []
    for i, slant_range in enumerate(view.range.values.tolist()):
        warmth = contrast(
            slant_range * 1e3,
            contrast_at_zero=given["contrast_at_zero"],
            extinction=given["extinction"] * 1e-3,
        )
        ways = [str(way) for way in view.super_resolution.values]
        for k, way in enumerate(ways if i else ways[:1]):
            here = view.isel(range=i, super_resolution=k)
            whole = here.image.transpose("row", "col").values.astype(np.float64)
            rows, cols = (np.isfinite(whole).any(axis=axis) for axis in (1, 0))
            image = whole[np.ix_(rows, cols)]
            how = {"frame_count": frames, "nedt": given["nedt"], "super_resolution": way}
            sigmas = {
                f"{name}_sigma": pixel_sigma(given[f"{name}_spread"], **how)
                for name in ("target", "sea")
            }
            method = str(view.segmentation.item())
            looks.append(
                Look(
                    slant_range=slant_range,
                    way=way,
                    across=here.horizontal.values[cols],
                    up=here.vertical.values[rows],
                    image=image,
                    mask=segment(image, method=method, contrast=warmth, **sigmas),
                    cells=here.log_polar.isel(phase=0).transpose("angle", "radius").values,
                )
            )
    return looks


def draw_silhouettes(images: xr.Dataset, configuration: Mapping[str, Any]) -> Figure:
    """Draw image, silhouette and log-polar map of a ship, a row per range and super-resolution.

    Values that the store lacks are replaced by their nearest neighbours, a ship by the first one.
    """
    kept = ("ship", "aspect", "range", "super_resolution", "frame_count", "phase")
    here = nominal(images, keep=kept)
    here = here.sel(aspect=ASPECT, frame_count=FRAMES, method="nearest")
    ships = [str(name) for name in here.ship.values]
    view = here.isel(ship=ships.index(SHIP) if SHIP in ships else 0).load()
    looks, inner = looks_of(view, configuration), view.inner_radius.item()

    # In inches: pixels are square on paper, so heights follow from what is shown [m].
    length, depth = (setting(view, configuration, f"window_{k}") for k in ("length", "height"))
    side, bottom, top = 0.475 * length, -0.07 * length, 0.9 * depth
    wide = 3.5
    high = wide * (top - bottom) / (2 * side)
    gap, head, foot = 0.1, 0.6, 0.34
    groups = [look.slant_range for look in looks]
    apart = [0.22 * (len(set(groups[: place + 1])) - 1) for place in range(len(looks))]
    width, height = 12.35, head + len(looks) * (high + gap) + apart[-1] + foot
    figure = Figure(figsize=(width, height), dpi=130)
    rows: list[list[Axes]] = []
    for place, look in enumerate(looks):
        base = height - head - (place + 1) * (high + gap) + gap - apart[place]
        image, silhouette, polar = row = [
            figure.add_axes((left / width, base / height, across / width, high / height))
            for left, across in ((1.8, wide), (6.0, wide), (10.15, 2.0))
        ]
        rows.append(row)
        _show_silhouette(silhouette, look, inner_radius=inner)
        _show_map(polar, look.cells, inner_radius=inner)
        for axes in (image, silhouette):
            axes.set(xlim=(-side, side), ylim=(bottom, top))
            axes.set_yticks([0, 20, 40])
        silhouette.set_yticklabels([])
        image.set_ylabel("up [m]", fontsize=LABEL)
        polar.set_ylabel("radius [√(area/π)]", fontsize=SMALL)
        how: Any = {"xycoords": "axes fraction", "color": INK}
        slant_range = f"{look.slant_range:g} km"
        image.annotate(slant_range, (-0.48, 0.72), fontsize=TITLE, weight="bold", **how)
        below = fill(WAYS.get(look.way, look.way), NARROW)
        pixel = f"{below}\n{look.pixel:.3g} m pixels"
        image.annotate(pixel, (-0.48, 0.66), fontsize=SMALL, va="top", **how)
        for axes in row:
            axes.tick_params(labelsize=SMALL, length=2.5, labelbottom=look is looks[-1])
    for one in dict.fromkeys(groups):
        pairs = zip(rows, looks, strict=True)
        _show_images([(row[0], look) for row, look in pairs if look.slant_range == one])
    for axes, title in zip(rows[0], TITLES, strict=True):
        axes.set_title(title, fontsize=HEADING)
    for axes, label in zip(rows[-1], LABELS, strict=True):
        axes.set_xlabel(label, fontsize=LABEL)
    name, aspect, frames = view.ship.item(), view.aspect.item(), view.frame_count.item()
    title = f"{str(name).capitalize()} in the passive infrared, aspect {aspect:g}°, {frames} frames"
    figure.suptitle(title, fontsize=TITLE, y=1 - 0.09 / height)
    return figure


def _show_images(group: list[tuple[Axes, Look]]) -> None:
    """Draw images of one range on one scale, with a colour bar."""
    every = np.concatenate([look.image.ravel() for _, look in group])
    ends = np.percentile(every, [0.5, 99.5])
    shown = [look.show(axes, look.image, "inferno", ends) for axes, look in group]
    first, last = group[0][0].get_position(), group[-1][0].get_position()
    figure = group[0][0].figure
    key = figure.add_axes((first.x1 + 0.006, last.y0, 0.008, first.y1 - last.y0))
    bar = figure.colorbar(shown[-1], cax=key)
    bar.outline.set_visible(False)
    bar.locator = MaxNLocator(5)
    key.set_xlabel("K", fontsize=SMALL, labelpad=1)
    key.xaxis.set_label_position("top")
    key.tick_params(labelsize=SMALL, length=2.5)


def _show_silhouette(axes: Axes, look: Look, *, inner_radius: float) -> None:
    """Draw a mask, its centroid, and the two circles between which it is mapped."""
    look.show(axes, look.mask, ListedColormap([SEA, INK]), (0, 1))
    axes.set_facecolor(SEA)
    if look.mask.any():
        for radius in (inner_radius, OUTER_RADIUS):
            rim = Circle(look.centroid, radius * look.unit, fill=False, color=RING, lw=0.9, ls="--")
            axes.add_patch(rim)
        axes.plot(*look.centroid, "+", color=RING, ms=6)


def _show_map(axes: Axes, cells: NDArray[np.float64], *, inner_radius: float) -> None:
    """Draw a log-polar map, from -90 to 270 degrees so that bow and stern are not cut."""
    angles, radii = cells.shape
    angle = np.linspace(-90, 270, angles + 1)
    radius = inner_radius * (OUTER_RADIUS / inner_radius) ** np.linspace(0, 1, radii + 1)
    turned = np.roll(cells, angles // 4, axis=0).T
    axes.pcolormesh(angle, radius, turned, cmap="Blues", vmin=0, vmax=1, rasterized=True)
    axes.set_yscale("log")
    ticks = [value for value in (0.5, 1, 2, 3) if inner_radius <= value <= OUTER_RADIUS]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_yticks([], minor=True)
    axes.set_xticks([-90, 0, 90, 180, 270])
