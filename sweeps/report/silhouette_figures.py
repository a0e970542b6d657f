"""Pictures of the infrared channel: images, silhouettes and log-polar maps.

    python -m sweeps.report.figures silhouettes STORE PICTURE
    python -m sweeps.report.figures formation STORE PICTURE
    python -m sweeps.report.figures table5 STORE PICTURE

They need matplotlib, from the `plot` extra.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ncti.features import log_polar, segment
from ncti.infrared import contrast, pixel_sigma
from sweeps.report import stored
from sweeps.report.axes import nominal
from sweeps.report.naming_figures import WAYS, draw_formation, draw_table5
from sweeps.report.stored import setting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = {
    "silhouettes": "infrared images, their silhouettes and log-polar maps, by range",
    "formation": "categories formed from silhouettes, by ship and aspect",
    "table5": "percent correct of silhouettes by range and super-resolution, beside the source's",
}

# The source's examples: its Figures 6 to 8.
SHIP, ASPECT, FRAMES = "spruance", 60.0, 16

INK, SEA = "#1d3b53", "#e4ecf1"
RING = "#c1440e"
DPI = 130
OUTER_RADIUS: float = inspect.signature(log_polar).parameters["outer_radius"].default


def draw(kind: str, path: Path) -> Figure:
    """A picture of a store, of one of `KINDS`."""
    if kind == "silhouettes":
        images = stored.read(path, "infrared")
        return draw_silhouettes(images, stored.attributes(path)["configuration"]["infrared"])
    classified = stored.read(path, "classification/acn_infrared").load()
    if kind == "formation":
        return draw_formation(classified)
    tables = stored.read(path, "tables/acn_infrared").load()
    return draw_table5(tables, ships=classified.sizes["ship"])


@dataclass(frozen=True)
class Look:
    """One image, and what is made of it.

    The centres of its pixels lie at across (col,) and up (row,) on the target [m]; image (row, col)
    is above the mean of the sea [K], mask (row, col) the silhouette, cells (angle, radius) its map
    as stored; slant_range [km], way how it got finer than the detector.
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
        half = self.pixel / 2
        return (
            self.across[0] - half,
            self.across[-1] + half,
            self.up[0] - half,
            self.up[-1] + half,
        )

    @property
    def centroid(self) -> tuple[float, float]:
        """Of the silhouette [m]; NaN where there is none."""
        if not self.mask.any():
            return math.nan, math.nan
        rows, columns = self.mask.nonzero()
        return float(self.across[columns].mean()), float(self.up[rows].mean())

    @property
    def unit(self) -> float:
        """Radius of the disc of the silhouette's area [m]."""
        return self.pixel * math.sqrt(int(self.mask.sum()) / math.pi)


def looks_of(view: xr.Dataset, configuration: Mapping[str, Any]) -> list[Look]:
    """The images of one view in one setting, by range, cut out as the sweep does it.

    The nearest is shown as the detector has it, others in all resolutions.
    """
    frame_count = view.frame_count.item()
    ways = [str(way) for way in view.super_resolution.values]
    looks = []
    for i, slant_range in enumerate(view.range.values.tolist()):
        warmth = contrast(
            slant_range * 1e3,
            contrast_at_zero=setting(view, configuration, "contrast_at_zero"),
            extinction=setting(view, configuration, "extinction") * 1e-3,
        )
        for k, way in enumerate(ways):
            if i == 0 and k > 0:
                continue
            here = view.isel(range=i, super_resolution=k)
            across, up = (here[name].values for name in ("horizontal", "vertical"))
            whole = here.image.transpose("row", "col").values.astype(np.float64)
            rows, cols = (np.isfinite(whole).any(axis=axis) for axis in (1, 0))
            image = whole[np.ix_(rows, cols)]
            sigmas = {
                f"{name}_sigma": pixel_sigma(
                    setting(view, configuration, f"{name}_spread"),
                    frame_count=frame_count,
                    nedt=setting(view, configuration, "nedt"),
                    super_resolution=way,
                )
                for name in ("target", "sea")
            }
            method = str(view.segmentation.item())
            looks.append(
                Look(
                    slant_range=slant_range,
                    way=way,
                    across=across[cols],
                    up=up[rows],
                    image=image,
                    mask=segment(image, method=method, contrast=warmth, **sigmas),
                    cells=here.log_polar.isel(phase=0).transpose("angle", "radius").values,
                )
            )
    return looks


def draw_silhouettes(images: xr.Dataset, configuration: Mapping[str, Any]) -> Figure:
    """What range and super-resolution make of a ship: image, silhouette and log-polar map.

    One row a range and resolution, one colour scale a range. Values that the store lacks are
    replaced by their nearest neighbours, a ship by the first one.
    """
    from matplotlib.figure import Figure

    kept = ("ship", "aspect", "range", "super_resolution", "frame_count", "phase")
    here = nominal(images, keep=kept)
    here = here.sel(aspect=ASPECT, method="nearest").sel(frame_count=FRAMES, method="nearest")
    ships = [str(name) for name in here.ship.values]
    view = here.isel(ship=ships.index(SHIP) if SHIP in ships else 0).load()
    looks = looks_of(view, configuration)

    # In inches: pixels are square on paper, so heights follow from what is shown [m].
    length, depth = (setting(view, configuration, f"window_{k}") for k in ("length", "height"))
    side, bottom, top = 0.475 * length, -0.07 * length, 0.9 * depth
    wide = 3.5
    high = wide * (top - bottom) / (2 * side)
    lefts, gap, head, foot = (1.5, 5.7, 9.75), 0.1, 0.6, 0.34
    groups = [look.slant_range for look in looks]
    apart = [0.22 * (len(set(groups[: place + 1])) - 1) for place in range(len(looks))]
    width, height = 11.95, head + len(looks) * (high + gap) + apart[-1] + foot
    figure = Figure(figsize=(width, height), dpi=DPI)
    rows = []
    for place, look in enumerate(looks):
        base = height - head - (place + 1) * (high + gap) + gap - apart[place]
        sizes = ((lefts[0], wide), (lefts[1], wide), (lefts[2], 2.0))
        row = [
            figure.add_axes((left / width, base / height, across / width, high / height))
            for left, across in sizes
        ]
        rows.append(row)
        _show_silhouette(row[1], look, inner_radius=view.inner_radius.item())
        _show_map(row[2], look.cells, inner_radius=view.inner_radius.item())
        for axes in row[:2]:
            axes.set(xlim=(-side, side), ylim=(bottom, top))
            axes.set_yticks([0, 20, 40])
        row[1].set_yticklabels([])
        row[0].set_ylabel("up [m]", fontsize=8)
        row[2].set_ylabel("radius [√(area/π)]", fontsize=8)
        _name_row(row[0], look)
        for axes in row:
            axes.tick_params(labelsize=7, length=2.5, labelbottom=look is looks[-1])
    for slant_range in dict.fromkeys(look.slant_range for look in looks):
        group = [(row[0], look) for row, look in zip(rows, looks, strict=True)]
        group = [(axes, look) for axes, look in group if look.slant_range == slant_range]
        _show_images(group)
    for axes, title in zip(
        rows[0],
        ("image above the sea [K]", "silhouette, and the ring that is mapped", "log-polar map"),
        strict=True,
    ):
        axes.set_title(title, fontsize=10)
    for axes, label in zip(
        rows[-1], ("across [m]", "across [m]", "angle [°], 0 right, 90 up"), strict=True
    ):
        axes.set_xlabel(label, fontsize=8)
    name, aspect, frames = view.ship.item(), view.aspect.item(), view.frame_count.item()
    figure.suptitle(
        f"{str(name).capitalize()} at {aspect:g}° in the passive infrared, {frames} frames",
        fontsize=12,
        y=1 - 0.09 / height,
    )
    return figure


def _name_row(axes: Axes, look: Look) -> None:
    text = f"{look.slant_range:g} km"
    axes.annotate(
        text, (-0.40, 0.72), xycoords="axes fraction", fontsize=12, weight="bold", color=INK
    )
    below = WAYS.get(look.way, look.way).replace("from ", "from\n")
    axes.annotate(
        f"{below}\n{look.pixel:.3g} m pixels",
        (-0.40, 0.66),
        xycoords="axes fraction",
        fontsize=8,
        color=INK,
        va="top",
    )


def _show_images(group: list[tuple[Axes, Look]]) -> None:
    """Images of one range on one scale, with a colour bar beside them."""
    from matplotlib.ticker import MaxNLocator

    every = np.concatenate([look.image.ravel() for _, look in group])
    low, high = np.percentile(every, [0.5, 99.5])
    for axes, look in group:
        shown = axes.imshow(
            look.image,
            origin="lower",
            extent=look.extent,
            cmap="inferno",
            vmin=low,
            vmax=high,
            interpolation="nearest",
        )
    first, last = group[0][0].get_position(), group[-1][0].get_position()
    figure = group[0][0].figure
    key = figure.add_axes((first.x1 + 0.006, last.y0, 0.008, first.y1 - last.y0))
    bar = figure.colorbar(shown, cax=key)
    bar.outline.set_visible(False)
    bar.locator = MaxNLocator(5)
    key.set_xlabel("K", fontsize=8, labelpad=1)
    key.xaxis.set_label_position("top")
    key.tick_params(labelsize=7, length=2.5)


def _show_silhouette(axes: Axes, look: Look, *, inner_radius: float) -> None:
    """A mask, with its centroid and the two circles between which it is mapped."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Circle

    axes.imshow(
        look.mask,
        origin="lower",
        extent=look.extent,
        cmap=ListedColormap([SEA, INK]),
        vmin=0,
        vmax=1,
        interpolation="nearest",
    )
    axes.set_facecolor(SEA)
    if look.mask.any():
        for radius in (inner_radius, OUTER_RADIUS):
            rim = Circle(look.centroid, radius * look.unit, fill=False, color=RING, lw=0.9, ls="--")
            axes.add_patch(rim)
        axes.plot(*look.centroid, "+", color=RING, ms=6)


def _show_map(axes: Axes, cells: NDArray[np.float64], *, inner_radius: float) -> None:
    """A log-polar map, from -90 to 270 degrees so that bow and stern stay whole."""
    angles, radii = cells.shape
    angle = np.linspace(-90, 270, angles + 1)
    radius = inner_radius * (OUTER_RADIUS / inner_radius) ** np.linspace(0, 1, radii + 1)
    axes.pcolormesh(
        angle,
        radius,
        np.roll(cells, angles // 4, axis=0).T,
        cmap="Blues",
        vmin=0,
        vmax=1,
        rasterized=True,
    )
    axes.set_yscale("log")
    ticks = [value for value in (0.5, 1, 2, 3) if inner_radius <= value <= OUTER_RADIUS]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_yticks([], minor=True)
    axes.set_xticks([-90, 0, 90, 180, 270])
