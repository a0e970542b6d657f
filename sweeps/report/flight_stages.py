"""Pictures of one flight: raw images, what each correction makes of them, and the truth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.ndimage import label as connected

from ncti.irar import (
    Correction,
    Flight,
    Scan,
    Snapshot,
    autofocus,
    correct,
    correct_as_printed,
    segmented,
    ship_window,
    time_delay_integrate,
    true_snapshot,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

STRIPES = 12.0
"""Metres of range that run once through the colours, as in the source's pseudo-colour images."""

MARGIN = 12
"""Pixels around the ship in corrected images."""


NO_LOOK, NO_RANGE = "#44566b", "0.62"
"""Of pixels that no sample fell into, and of those that were looked at and have no range."""

BRIGHTEST = 99.0  # percent of the ship's pixels that are not brighter than the scale

SHIFTS = {"pixel": "", "line": " by line", "constant": " by one constant"}
TURNS = {"exact": "sheared", "printed": "sheared by the printed angle", "rotation": "turned"}


@dataclass(frozen=True, kw_only=True)
class Way:
    """How a flight is corrected, and what of a ship it is held against.

    Of the source's own chain, as printed, `rate` is what it takes for f, `line` or `pulse`; else
    `correction` is ours. The closing speed may be looked for in the image (autofocus); `threshold`,
    of segmentation, is in noise powers, and `surface` says how the ship reflects.
    """

    rate: str | None = None
    correction: Correction = field(default_factory=Correction)
    autofocus: bool = False
    threshold: float | None = None
    surface: Mapping[str, Any] = field(default_factory=dict)

    def belief(self, scan: Scan) -> Flight:
        """What the corrections take for the flight."""
        if self.autofocus:
            with suppress(ValueError):  # no ship in the image
                return autofocus(scan, scan.flight)
        return scan.flight


@dataclass(frozen=True, eq=False)
class Stage:
    """Images after some of the corrections: (row, column) arrays.

    Intensity in noise powers, range in metres from the ship's origin, infrared in kelvin; pixels
    that no sample fell into are unseen. The extent is left, right, bottom and top [pixel or line].
    """

    title: str
    intensity: NDArray[np.floating]
    range: NDArray[np.floating]
    infrared: NDArray[np.floating]
    unseen: NDArray[np.bool_]
    extent: tuple[float, float, float, float]
    square: bool = True


def stages(mesh: trimesh.Trimesh, scan: Scan, way: Way | None = None) -> list[Stage]:
    """Every stage of the chain, as the source shows them in its Figures 10, 11 and 13.

    Overscanned; averaged, of corrected range and segmented; also shifted in azimuth; also sheared,
    which is all; and the truth. Without those that are left out; of the source's own chain all
    corrections at once.
    """
    way = Way() if way is None else way
    belief, lines, samples = way.belief(scan), *scan.intensity.shape
    found = [
        Stage(
            "overscanned",
            scan.intensity,
            scan.range - scan.flight.slant_range,
            time_delay_integrate(scan.infrared),
            np.zeros(scan.intensity.shape, dtype=bool),
            (0, samples, 0, lines),
            square=False,
        )
    ]
    for title, image in _corrected(scan, way, belief):
        shown = segmented(image, belief, threshold=way.threshold)
        found.append(_stage(title, shown, belief.slant_range))
    window = ship_window(mesh, scan.flight, margin=MARGIN)
    truth = true_snapshot(mesh, scan.flight, window, **way.surface)
    found.append(_stage("the truth, noiseless", truth, scan.flight.slant_range))
    return found


def _corrected(scan: Scan, way: Way, belief: Flight) -> Iterator[tuple[str, Snapshot]]:
    """The image after each correction, with what was done last."""
    if way.rate is not None:
        title = f"all corrections as printed,\nf the {way.rate} rate"
        yield title, correct_as_printed(scan, belief=belief, rate=way.rate)
        return
    whole = way.correction
    title = "averaged, range corrected, segmented"
    if whole.range_filter != Correction().range_filter:
        title = f"averaged, range corrected by {whole.range_filter}, segmented"
    chain = {title: replace(whole, azimuth="none", mirror="none")}
    if whole.azimuth != "none":
        chain[f"shifted in azimuth{SHIFTS[whole.azimuth]}"] = replace(whole, mirror="none")
    if whole.mirror != "none":
        chain[TURNS[whole.mirror]] = whole
    for title, how in chain.items():
        last = ": all corrections" if how == whole else ""
        yield title + last, correct(scan, how, belief=belief)


def _stage(title: str, image: Snapshot, slant_range: float) -> Stage:
    """A stage, cut to its ship: the largest of what pulses find or what is warm."""
    warm = np.nan_to_num(image.infrared)
    found = (np.nan_to_num(image.intensity) > 0) | (warm > warm.max() / 4)
    pieces, count = connected(found, structure=np.ones((3, 3)))
    largest = 1 + np.bincount(pieces.ravel(), minlength=2)[1:].argmax()
    seen = pieces == largest if count else np.ones(found.shape, dtype=bool)
    part = tuple(
        slice(max(0, lit[0] - MARGIN // 2), lit[-1] + 1 + MARGIN // 2)
        for lit in (np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0))
    )
    row, column = image.row[part[0]], image.column[part[1]]
    return Stage(
        title,
        image.intensity[part],
        image.range[part] - slant_range,
        image.infrared[part],
        image.looks[part] == 0,
        (column[0] - 0.5, column[-1] + 0.5, row[0] - 0.5, row[-1] + 0.5),
    )


def draw_stages(mesh: trimesh.Trimesh, scan: Scan, way: Way | None = None, *, title: str) -> Figure:
    """Intensity, range and infrared images at every stage of the chain.

    One shade is one intensity in all its images, and one colour one temperature in the corrected
    ones.
    """
    from matplotlib.figure import Figure

    every = stages(mesh, scan, way)
    left, right, bottom, top = every[-1].extent
    wide = right - left > 1.5 * (top - bottom)
    # A ship from abeam is wide: its stages go below one another.
    size = (13.5, 2.2 * len(every)) if wide else (3.1 * len(every), 9.0)
    figure = Figure(figsize=size, dpi=130, layout="constrained")
    panels = figure.subplots(*((len(every), 3) if wide else (3, len(every))), squeeze=False)
    panels = panels if wide else panels.T
    top_intensity = brightest([stage.intensity for stage in every[1:]])
    warmth = np.concatenate([stage.infrared[~stage.unseen] for stage in every[1:-1]])
    coldest, warmest = (
        np.percentile(warmth, (100 - BRIGHTEST, BRIGHTEST)) if warmth.size else (0, 1)
    )
    for row, stage in zip(panels, every, strict=True):
        last, raw = stage is every[-1], stage is every[0]
        heat = {"low": 0, "high": 1} if last else {} if raw else {"low": coldest, "high": warmest}
        shown = [
            _show(row[0], stage, stage.intensity, "gray", low=0, high=top_intensity),
            _show(row[1], stage, np.mod(stage.range, STRIPES), "twilight", low=0, high=STRIPES),
            _show(row[2], stage, stage.infrared, "inferno", **heat),
        ]
        labels = [
            "intensity [noise powers]",
            f"range, modulo {STRIPES:g} m",
            "share of ship" if last else "above the sea [K]",
        ]
        for k, (axes, image, label) in enumerate(zip(row, shown, labels, strict=True)):
            axes.set_xlabel("column [pixel]" if stage.square else "sample", fontsize=7)
            axes.set_ylabel("row [pixel]" if stage.square else "line", fontsize=7)
            extend = "max" if k == 0 else "both" if k == 2 and heat and not last else "neither"
            bar = figure.colorbar(image, ax=axes, shrink=0.8, pad=0.02, extend=extend)
            bar.set_label(label, fontsize=7)
            bar.ax.tick_params(labelsize=6)
        row[0].set_title(stage.title, fontsize=9, loc="left")
    figure.suptitle(title, fontsize=11)
    if any(stage.unseen.any() for stage in every):
        figure.supxlabel(
            "slate blue: no sample fell there; black, and grey of ranges: looked at, no ship",
            fontsize=8,
            color="0.3",
        )
    return figure


def brightest(images: Sequence[NDArray[np.floating]]) -> float:
    """Upper end of a scale of intensity that images share, in their unit; 1 where all are dark.

    Each image's own share of pixels may be brighter: the truth, in which nothing speckles, or the
    corrected images, whose noise is all there is of a faint ship.
    """
    lit = (image[np.nan_to_num(image) > 0] for image in images)
    return max((float(np.percentile(one, BRIGHTEST)) for one in lit if one.size), default=1.0)


def _show(
    axes: Axes,
    stage: Stage,
    values: NDArray[np.floating],
    colours: str,
    *,
    low: float | None = None,
    high: float | None = None,
) -> ScalarMappable:
    from matplotlib.colors import ListedColormap

    where: dict[str, Any] = {
        "origin": "lower",
        "extent": stage.extent,
        "aspect": "equal" if stage.square else "auto",
        "interpolation": "nearest",
    }
    axes.set_facecolor(NO_RANGE)
    shown = axes.imshow(values, cmap=colours, vmin=low, vmax=high, **where)
    if stage.unseen.any():
        nothing = np.ma.masked_where(~stage.unseen, stage.unseen)
        axes.imshow(nothing, cmap=ListedColormap([NO_LOOK]), **where)
    axes.tick_params(labelsize=7)
    return shown
