"""Pictures of one flight: raw images, what each correction makes of them, and the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import trimesh
from numpy.typing import NDArray

from ncti.irar import (
    Correction,
    Scan,
    Snapshot,
    correct,
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


@dataclass(frozen=True, eq=False)
class Stage:
    """Images after some of the corrections.

    Attributes
    ----------
    title : str
        Which.
    intensity, range, infrared : (row, column) float64 ndarray
        In noise powers, metres from the ship's origin, and kelvin.
    extent : (float, float, float, float)
        Left, right, bottom and top [pixel or line].
    square : bool
        Whether rows and columns are equally wide.
    """

    title: str
    intensity: NDArray[np.floating]
    range: NDArray[np.floating]
    infrared: NDArray[np.floating]
    extent: tuple[float, float, float, float]
    square: bool = True


def stages(mesh: trimesh.Trimesh, scan: Scan) -> list[Stage]:
    """Every stage of the chain, as the source shows them in its Figures 10, 11 and 13.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    scan : Scan
        Raw images of it.

    Returns
    -------
    list of Stage
        Overscanned; averaged, of corrected range and segmented; also shifted in azimuth; also
        sheared, which is all; and the truth.
    """
    flight = scan.flight
    lines, samples = scan.intensity.shape
    found = [
        Stage(
            "overscanned",
            scan.intensity,
            scan.range - flight.slant_range,
            time_delay_integrate(scan.infrared),
            (0, samples, 0, lines),
            square=False,
        )
    ]
    chain = {
        "averaged, range corrected, segmented": Correction(azimuth="none", mirror="none"),
        "shifted in azimuth": Correction(mirror="none"),
        "sheared: all corrections": Correction(),
    }
    for title, how in chain.items():
        image = segmented(correct(scan, how), flight)
        found.append(_stage(title, image, flight.slant_range))
    window = ship_window(mesh, flight, margin=MARGIN)
    truth = true_snapshot(mesh, flight, window)
    found.append(_stage("the truth, noiseless", truth, flight.slant_range))
    return found


def _stage(title: str, image: Snapshot, slant_range: float) -> Stage:
    """A stage, cut to its ship."""
    lit = np.nan_to_num(image.intensity) > 0
    # A lone pixel of the sea above the threshold is no ship.
    rows, columns = (np.flatnonzero(lit.sum(axis=axis) > 2) for axis in (1, 0))
    if not len(rows) or not len(columns):
        rows, columns = np.arange(lit.shape[0]), np.arange(lit.shape[1])
    part = tuple(
        slice(max(0, seen[0] - MARGIN // 2), seen[-1] + 1 + MARGIN // 2) for seen in (rows, columns)
    )
    row, column = image.row[part[0]], image.column[part[1]]
    return Stage(
        title,
        np.where(image.looks == 0, np.nan, image.intensity)[part],
        image.range[part] - slant_range,
        image.infrared[part],
        (column[0] - 0.5, column[-1] + 0.5, row[0] - 0.5, row[-1] + 0.5),
    )


def draw_stages(mesh: trimesh.Trimesh, scan: Scan, *, title: str) -> Figure:
    """Intensity, range and infrared images at every stage of the chain.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    scan : Scan
        Raw images of it.
    title : str
        Of the whole.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    every = stages(mesh, scan)
    left, right, bottom, top = every[-1].extent
    wide = right - left > 1.5 * (top - bottom)
    # A ship from abeam is wide: its stages go below one another.
    size = (13.5, 2.2 * len(every)) if wide else (3.1 * len(every), 9.0)
    figure = Figure(figsize=size, dpi=130, layout="constrained")
    panels = figure.subplots(*((len(every), 3) if wide else (3, len(every))), squeeze=False)
    panels = panels if wide else panels.T
    brightest = float(np.nanpercentile(every[-1].intensity[every[-1].intensity > 0], 99))
    for row, stage in zip(panels, every, strict=True):
        last = stage is every[-1]
        shown = [
            _show(row[0], stage, np.clip(stage.intensity, 0, 1.6 * brightest), "gray"),
            _show(row[1], stage, np.mod(stage.range, STRIPES), "twilight", low=0, high=STRIPES),
            _show(row[2], stage, stage.infrared, "inferno"),
        ]
        labels = [
            "intensity [noise powers]",
            f"range, modulo {STRIPES:g} m",
            "share of ship" if last else "above the sea [K]",
        ]
        for axes, image, label in zip(row, shown, labels, strict=True):
            axes.set_xlabel("column [pixel]" if stage.square else "sample", fontsize=7)
            axes.set_ylabel("row [pixel]" if stage.square else "line", fontsize=7)
            bar = figure.colorbar(image, ax=axes, shrink=0.8, pad=0.02)
            bar.set_label(label, fontsize=7)
            bar.ax.tick_params(labelsize=6)
        row[0].set_title(stage.title, fontsize=9, loc="left")
    figure.suptitle(title, fontsize=11)
    return figure


def _show(
    axes: Axes,
    stage: Stage,
    values: NDArray[np.floating],
    colours: str,
    *,
    low: float | None = None,
    high: float | None = None,
) -> ScalarMappable:
    shown = axes.imshow(
        values,
        origin="lower",
        extent=stage.extent,
        aspect="equal" if stage.square else "auto",
        cmap=colours,
        interpolation="nearest",
        vmin=low,
        vmax=high,
    )
    axes.tick_params(labelsize=7)
    axes.set_facecolor("0.85")
    return shown
