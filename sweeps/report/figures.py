"""Pictures: the ships, their range profiles, and how well they are told apart.

    python -m sweeps.report.figures ships PICTURE
    python -m sweeps.report.figures profiles STORE PICTURE
    python -m sweeps.report.figures tables STORE PICTURE

and those of `sweeps.report.silhouette_figures`, `classifier_figures` and `flight_figures`. They
need matplotlib, from the `plot` extra.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

import ncti.ships
from ncti.features import profile_vector
from sweeps.report import classifier_figures, flight_figures, silhouette_figures, stored
from sweeps.report.axes import nominal, which
from sweeps.report.panels import by_bin, with_intervals
from sweeps.report.portraits import Portrait, portrait
from sweeps.report.rows import BIN
from sweeps.report.tables import accuracy_rows, source_figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = {
    "profiles": "range profiles by aspect, by ship and by number of frames",
    "tables": "percent correct by aspect and number of frames, beside the source's",
}
OTHERS = (silhouette_figures, classifier_figures, flight_figures)

# The source's examples: its Figures 3 to 5 and its Table 4.
ASPECTS, ASPECT, PULSE_WIDTH, VIGILANCE = (0.0, 30.0, 60.0, 90.0), 30.0, 30.0, 0.95

FLEET = (("duncan", "spruance"), ("roberts", "texas"), ("connole", "horne"))
VIEW = {"aspect": 57.0, "depression": 10.0}  # [deg]
PIXEL = 0.18  # of the picture of the ships [m]
NEAR_AND_FAR = 56.0  # the colours of ranges span this much to either side of the origin [m]
SEA, INK = "#0b1626", "#e8eef2"
NEAR_COLOUR, MIDDLE_COLOUR, FAR_COLOUR = "#ffe6b8", "#8ed3c0", "#3f8ddb"

STEP, NOISY_STEP = 1.12, 1.7  # from one profile to the next, in peaks


def main() -> None:
    """Run the command line; exits with 2 when the picture cannot be made."""
    parser = argparse.ArgumentParser(
        prog="python -m sweeps.report.figures", description="Draw pictures of ships and sweeps."
    )
    kinds = parser.add_subparsers(dest="kind", required=True)
    kinds.add_parser("ships", help="the six ships, from their range images")
    every = KINDS | {kind: text for other in OTHERS for kind, text in other.KINDS.items()}
    for kind, text in every.items():
        kinds.add_parser(kind, help=text).add_argument(
            "store", type=Path, help="store of a sweep, such as sweep.zarr"
        )
    for subparser in kinds.choices.values():
        subparser.add_argument("picture", type=Path, help="file to write, such as ships.png")
    arguments = parser.parse_args()
    try:
        figure = draw(arguments.kind, getattr(arguments, "store", None))
    except ImportError:
        print("figures: matplotlib is missing: install ncti-sweep[plot]", file=sys.stderr)
        sys.exit(2)
    except (OSError, KeyError, ValueError) as error:
        print(f"figures: {arguments.kind} cannot be drawn: {error}", file=sys.stderr)
        sys.exit(2)
    figure.savefig(arguments.picture)


def draw(kind: str, path: Path | None) -> Figure:
    """A picture of the ships, or of a store."""
    if path is None:
        return draw_ships()
    for other in OTHERS:
        if kind in other.KINDS:
            return other.draw(kind, path)
    if kind == "profiles":
        return draw_profiles(stored.read(path, "range_profile").load())
    return draw_tables(stored.read(path, "tables/acn").load())


def draw_ships() -> Figure:
    """The six ships to one scale, coloured by range."""
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure

    ramp = LinearSegmentedColormap.from_list("range", [NEAR_COLOUR, MIDDLE_COLOUR, FAR_COLOUR])

    def tint(down_range: ArrayLike) -> NDArray[np.float64]:
        return np.asarray(ramp(np.asarray(down_range) / (2 * NEAR_AND_FAR) + 0.5))

    width, height, dpi = 318.0, 186.0, 200.0
    figure = Figure(figsize=(width / PIXEL / dpi, height / PIXEL / dpi), dpi=dpi, facecolor=SEA)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, width), ylim=(0.0, height), aspect="equal")
    axes.axis("off")
    for row, waterline in zip(FLEET, (136.0, 80.0, 25.0), strict=True):
        for name, left in zip(row, (8.0, 150.0), strict=True):
            mesh = ncti.ships.load(name)
            picture = portrait(mesh, **VIEW, pixel=PIXEL, tint=tint)
            _stand(axes, picture, x=left - picture.extent[0], y=waterline)
            _name(axes, name, mesh.metadata["loa"], x=left + 1.0, y=waterline + 22.0)
    _scale_bar(axes, x=10.0, y=7.0, length=50.0)
    _range_key(axes, tint, x=width - 92.0, y=7.0, length=60.0)
    return figure


def _stand(axes: Axes, picture: Portrait, *, x: float, y: float) -> None:
    """Put a portrait with its origin near (x, y), pixel on pixel."""
    x, y = (round(value / PIXEL) * PIXEL for value in (x, y))
    left, right, bottom, top = picture.extent
    axes.imshow(
        picture.colour,
        origin="lower",
        extent=(left + x, right + x, bottom + y, top + y),
        interpolation="nearest",
    )


def _name(axes: Axes, name: str, length: float, *, x: float, y: float) -> None:
    axes.text(x, y, name.capitalize(), color=INK, fontsize=11, weight="bold", va="bottom")
    axes.text(x, y - 1.0, f"{length:.1f} m", color=INK, fontsize=8, alpha=0.75, va="top")


def _scale_bar(axes: Axes, *, x: float, y: float, length: float) -> None:
    axes.plot([x, x, x + length, x + length], [y + 1, y, y, y + 1], color=INK, linewidth=1)
    text = f"{length:.0f} m across the line of sight"
    axes.text(x + length + 2, y, text, color=INK, fontsize=7, va="center")


def _range_key(
    axes: Axes,
    tint: Callable[[ArrayLike], NDArray[np.float64]],
    *,
    x: float,
    y: float,
    length: float,
) -> None:
    ramp = tint(np.linspace(-NEAR_AND_FAR, NEAR_AND_FAR, 256))[None]
    axes.imshow(ramp, extent=(x, x + length, y - 1.2, y + 1.2))
    near, far = f"−{NEAR_AND_FAR:.0f} m", f"+{NEAR_AND_FAR:.0f} m"
    axes.text(x - 2, y, f"down-range {near}", color=INK, fontsize=7, va="center", ha="right")
    axes.text(x + length + 2, y, far, color=INK, fontsize=7, va="center")


def draw_profiles(profiles: xr.Dataset) -> Figure:
    """Profiles as a classifier sees them: what aspect, ship and averaging make of them.

    Three panels of profiles above their noise floor, each with its peak as unit. Values that the
    store lacks are replaced by their nearest neighbours.
    """
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    here = nominal(profiles, keep=("ship", "aspect", "range", "pulse_width", "frame_count"))
    here = here.sel(range=100.0, method="nearest")
    here = here.sel(pulse_width=PULSE_WIDTH, method="nearest")
    first = here.isel(ship=0)
    name = first.ship.item().capitalize()
    turned = first.expected.sel(aspect=list(ASPECTS), method="nearest").drop_duplicates("aspect")
    quarter = here.sel(aspect=ASPECT, method="nearest")
    expected = quarter.expected.isel(ship=0)
    averaged = quarter.averaged.isel(ship=0).sortby("frame_count")

    figure = Figure(figsize=(11.0, 4.4), dpi=160, layout="constrained")
    by_aspect, by_ship, by_frames = figure.subplots(1, 3)
    _stack(
        by_aspect,
        turned,
        labels=[f"{aspect:g}°" for aspect in turned.aspect.values],
        colours=colormaps["viridis"](np.linspace(0.1, 0.75, turned.sizes["aspect"])),
    )
    by_aspect.set_title(f"{name} from bow (0°) to beam (90°)", fontsize=10)
    _stack(
        by_ship,
        quarter.expected,
        labels=[label.capitalize() for label in quarter.ship.values],
        colours=colormaps["Dark2"](np.arange(quarter.sizes["ship"]) % 8),
    )
    by_ship.set_title(f"Ships at {quarter.aspect.item():g}°", fontsize=10)
    frames = averaged.frame_count.values
    _stack(
        by_frames,
        averaged,
        labels=["1 frame" if count == 1 else f"{count} frames" for count in frames],
        colours=colormaps["Reds"](np.linspace(0.5, 0.9, len(frames))),
        behind=expected,
    )
    by_frames.set_title(
        f"{name} at {quarter.aspect.item():g}°, averages over the expected", fontsize=10
    )
    by_aspect.set_ylabel("amplitude above the noise floor, peak 1")
    figure.suptitle(
        f"Range profiles at {here.range.item():g} km, {here.pulse_width.item():g} ns pulses",
        fontsize=11,
    )
    return figure


def _stack(
    axes: Axes,
    profiles: xr.DataArray,
    *,
    labels: list[str],
    colours: ArrayLike,
    behind: xr.DataArray | None = None,
) -> None:
    """Profiles above each other, the first on top, with another one behind each."""
    down_range = profiles.down_range.values
    step = STEP if behind is None else NOISY_STEP
    lines = zip(profile_vector(profiles), labels, np.asarray(colours), strict=True)
    for place, (profile, label, colour) in enumerate(lines):
        base = step * (len(labels) - 1 - place)
        axes.axhline(base, color="0.85", linewidth=0.6, zorder=0)
        if behind is None:
            axes.fill_between(down_range, base, base + profile, color=colour, alpha=0.25, lw=0)
        else:
            shade = base + profile_vector(behind)
            axes.fill_between(down_range, base, shade, color="0.8", lw=0)
        axes.plot(down_range, base + profile, color=colour, linewidth=1.1)
        axes.text(down_range[-1] + 4.0, base, label, color=colour, weight="bold", va="center")
    axes.set(xlim=(down_range[0], down_range[-1]), xlabel="down-range from the ship origin [m]")
    axes.set_yticks([])
    axes.spines[["left", "right", "top"]].set_visible(False)


def draw_tables(tables: xr.Dataset) -> Figure:
    """Percent correct against the number of frames, one panel a bin, beside the source's."""
    kept = ("range", "pulse_width", "vigilance", "frame_count", "aspect_bin")
    here = nominal(tables, keep=kept)
    nearest = {"pulse_width": PULSE_WIDTH, "vigilance": VIGILANCE, "range": 100.0}
    here = here.sel({axis: [value] for axis, value in nearest.items()}, method="nearest")
    rows = accuracy_rows(here)
    figure, panels, bins = by_bin(rows, high=3.4)
    for axes, label in zip(panels, bins, strict=True):
        # Numbers of frames ascending, training last.
        line = [row for row in rows if row[BIN] == label and row["percent_correct"] is not None]
        line.sort(key=lambda row: row["frame_count"] or np.inf)
        place = range(len(line))
        with_intervals(axes, dict(enumerate(line)), "o-", color="#1f4e79", label="ours, 95 %")
        theirs = {k: line[k]["source_percent"] for k in place if line[k]["source_percent"]}
        if theirs:
            shown = ([*theirs], [*theirs.values()])
            axes.plot(*shown, "s--", color="#c1440e", mfc="white", label="source")
        axes.set_xticks(place, [str(row["frame_count"] or "expected") for row in line], fontsize=8)
    panels[0].legend(frameon=False, loc="lower right", fontsize=8)
    below = ["frames averaged; expected: the training profiles"]
    if any(row["source_percent"] is not None for row in rows):
        below.append(source_figures()["table4_percent_correct"]["note"])
    figure.supxlabel("\n".join(below), fontsize=8)
    pulse_width, vigilance = here.pulse_width.item(), here.vigilance.item()
    title = f"Ships identified by the ACN, {pulse_width:g} ns, vigilance {vigilance:g}"
    figure.suptitle(title + which(here.squeeze(), tables, but=kept), fontsize=11)
    return figure


if __name__ == "__main__":
    main()
