"""Error and time of a fixed set of views, release by release, in a file of the repository."""

from __future__ import annotations

import csv
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from numpy.typing import NDArray

import ncti
import ncti.ships
from benchmarks.methods import direct_embree
from benchmarks.reports import Column, Report
from benchmarks.views import DEPRESSION, EDGES, PULSE_WIDTH
from ncti.ladar import RangeExtent, range_extent
from ncti.ladar.pulse import Pulse, target_response
from ncti.render import Sampling
from ncti.render.view import ROLL, View
from studies.run_time.reference import reference_range_extent
from sweeps.stages.views import LINES, Render, image

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = Path(__file__).resolve().parent
FILE = FOLDER / "history.csv"
PICTURE = FOLDER.parent / "docs" / "history.svg"

SHIPS = ("duncan", "texas")
ASPECTS = (0.0, 20.3, 60.0, 90.0)  # [deg]
SLANT_RANGE = 25e3  # [m]
TOLERANCE = 1e-3
FRAMES = 16

Floats = NDArray[np.float64]
Make = Callable[[trimesh.Trimesh, float], RangeExtent | None]
"""Function of a mesh and an aspect [deg] that makes an extent, or something without one."""


@dataclass(frozen=True)
class Entry:
    """One way to see the fixed views, measured on one day.

    Attributes
    ----------
    date : str
        Day of the measurement, UTC.
    version : str
        Of the library.
    way : str
        Key of `WAYS`.
    error, worst : float or None
        Median and largest error of a range extent after 30 ns, sum |p - q| / sum q [%]; None of
        a way that shows no extent.
    bound : float or None
        Median of the stated error over the true one; None without a statement.
    time : float
        Median of the processor time over that of casting a ray per 0.25 m pixel with embree, timed
        in the same turn.
    """

    date: str
    version: str
    way: str
    error: float | None
    worst: float | None
    bound: float | None
    time: float

    def __post_init__(self) -> None:
        if self.way not in WAYS:
            raise ValueError(f"way is {self.way!r}, but must be one of {', '.join(WAYS)}")
        datetime.strptime(self.date, "%Y-%m-%d")
        for name in ("error", "worst", "bound", "time"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ValueError(f"{name} is {value!r}, but must be positive")


def _sweep_method(engine: str, fineness: tuple[float, ...] = ()) -> Make:
    """Return a function that makes an extent as a sweep does by default."""

    def make(mesh: trimesh.Trimesh, aspect: float) -> RangeExtent:
        view = image.function(
            mesh,
            drawn_aspect=aspect,
            depression=DEPRESSION,
            drawn_range=SLANT_RANGE,
            sampling=Sampling(engine, Render.pixel.default, Render.samples.default, ROLL),
            fineness=fineness,
        )
        return range_extent(view, slant_range=SLANT_RANGE)

    return make


def _simulate_profile(mesh: trimesh.Trimesh, aspect: float) -> None:
    """Simulate a profile of a ship by name, with all defaults but range and frames."""
    name = mesh.metadata["name"]
    ncti.simulate.range_profile(name, aspect=aspect, slant_range=SLANT_RANGE, frames=FRAMES)


WAYS: dict[str, tuple[str, Make]] = {
    "embree": ("pixels of 0.25 m by embree", _sweep_method("embree")),
    "lines": ("lines 0.25 m apart", _sweep_method(LINES)),
    "tolerance": (
        f"lines within {TOLERANCE:g}",
        _sweep_method(LINES, (TOLERANCE, PULSE_WIDTH, 1.0)),
    ),
    "profile": (f"simulate.range_profile, {FRAMES} frames", _simulate_profile),
}
"""Measured ways: their description, and the function of each."""


def measure(
    *, repeats: int, ships: Sequence[str] = SHIPS, aspects: Sequence[float] = ASPECTS
) -> list[Entry]:
    """Return an entry of today for each way.

    Parameters
    ----------
    repeats : int
        How often each view is timed.
    ships : sequence of str
        Names.
    aspects : sequence of float
        Aspects [deg].
    """
    errors: dict[str, list[float]] = {way: [] for way in WAYS}
    bounds: dict[str, list[float]] = {way: [] for way in WAYS}
    ratios: dict[str, list[float]] = {way: [] for way in WAYS}
    for name in ships:
        mesh = ncti.ships.load(name)
        cast = direct_embree(mesh, 0.25)
        for aspect in aspects:
            exact = _exact_extent(mesh, aspect)
            for way, (_, make) in WAYS.items():
                extent = make(mesh, aspect)  # and warms up
                if extent is not None:
                    errors[way].append(_error(extent, exact))
                    bounds[way].append(extent.error_after(PULSE_WIDTH) / errors[way][-1])
            cast(View(aspect, DEPRESSION))
            turns = [_time_methods(mesh, aspect, cast) for _ in range(repeats)]
            for way, ratio in ratios.items():
                ratio.append(statistics.median(turn[way] for turn in turns))
    today, version = datetime.now(UTC).strftime("%Y-%m-%d"), ncti.__version__
    return [
        Entry(
            today,
            version,
            way,
            error=_round_value(100 * np.median(errors[way])) if errors[way] else None,
            worst=_round_value(100 * max(errors[way])) if errors[way] else None,
            bound=_round_value(np.median(bounds[way])) if np.isfinite(bounds[way]).any() else None,
            time=_round_value(statistics.median(ratios[way])),
        )
        for way in WAYS
    ]


def _exact_extent(mesh: trimesh.Trimesh, aspect: float) -> Floats:
    """Return the sampling-free extent of the whole ship [m^2]."""
    geometry = {"aspect": aspect, "depression": DEPRESSION, "slant_range": SLANT_RANGE}
    return reference_range_extent(mesh, bin_edges=EDGES, **geometry).area.sum(axis=0)


def _error(extent: RangeExtent, exact: Floats) -> float:
    """Return the error of an extent after the pulse."""
    response = target_response(Pulse(PULSE_WIDTH, 1.0)) ** 2
    area = extent.fraction.sum(axis=0) * (extent.ifov * extent.slant_range) ** 2
    p, q = np.convolve(area, response), np.convolve(exact, response)
    return float(np.abs(p - q).sum() / q.sum())


def _time_methods(
    mesh: trimesh.Trimesh, aspect: float, cast: Callable[[View], Any]
) -> dict[str, float]:
    """Return the processor time of each way, over the mean of a cast before and after it."""
    view = View(aspect, DEPRESSION)
    before = _time_call(cast, view)
    ratios = {}
    for way, (_, make) in WAYS.items():
        seconds = _time_call(make, mesh, aspect)
        after = _time_call(cast, view)
        ratios[way] = seconds / ((before + after) / 2)
        before = after
    return ratios


def _time_call(call: Callable[..., Any], *arguments: Any) -> float:
    start = time.process_time()
    call(*arguments)
    return time.process_time() - start


def _round_value(value: float | np.floating) -> float:
    return float(f"{value:.3g}")


def read(file: Path = FILE) -> list[Entry]:
    """Return the entries of a file, in order; ValueError names its fault."""
    names = [field.name for field in fields(Entry)]
    with file.open(encoding="utf-8", newline="") as lines:
        table = csv.DictReader(lines)
        if table.fieldnames != names:
            raise ValueError(f"{file.name} has columns {table.fieldnames}, but must have {names}")
        words = names[:3]
        return [
            Entry(
                **{key: row[key] if key in words else _number(row[key]) for key in names}  # type: ignore[arg-type]
            )
            for row in table
        ]


def _number(text: str) -> float | None:
    return float(text) if text else None


def append(entries: Sequence[Entry], file: Path = FILE) -> None:
    """Append entries to a file, after checking it, or create it."""
    new = not file.exists()
    if not new:
        read(file)
    with file.open("a", encoding="utf-8", newline="") as lines:
        table = csv.DictWriter(lines, [field.name for field in fields(Entry)], lineterminator="\n")
        if new:
            table.writeheader()
        table.writerows(asdict(entry) for entry in entries)


def report(entries: Sequence[Entry]) -> Report:
    """Return a table of entries."""
    return Report(
        f"Views of {', '.join(SHIPS)} at {SLANT_RANGE / 1e3:g} km, "
        f"aspects {', '.join(f'{aspect:g}' for aspect in ASPECTS)}°, 30 ns",
        (
            Column("date", "date"),
            Column("version", "version"),
            Column("what", "way"),
            Column("error", "error, median [%]", ".3g"),
            Column("worst", "worst [%]", ".3g"),
            Column("bound", "stated / true", ".3g"),
            Column("time", "time, x embree", ".3g"),
        ),
        [asdict(entry) | {"what": WAYS[entry.way][0]} for entry in entries],
        [
            "Error: sum of absolute differences from the sampling-free reference over its sum, "
            "after the pulse. Time: processor time over that of casting one ray per 0.25 m pixel "
            "with embree, in the same turn."
        ],
    )


def draw(entries: Sequence[Entry]) -> Figure:
    """Return a figure of error and time of every way, entry by entry."""
    from matplotlib.figure import Figure

    days = list(dict.fromkeys((entry.date, entry.version) for entry in entries))
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    panels = figure.subplots(1, 2)
    for way, (label, _) in WAYS.items():
        by_day = {(entry.date, entry.version): entry for entry in entries if entry.way == way}
        for panel, name in zip(panels, ("error", "time"), strict=True):
            values = [getattr(by_day.get(day), name, None) for day in days]
            if any(value is not None for value in values):
                panel.plot([np.nan if v is None else v for v in values], "o-", label=label)
    for panel, title in zip(panels, ("error, median [%]", "time, relative to embree"), strict=True):
        panel.set(title=title, yscale="log", xlim=(-0.5, len(days) - 0.5))
        panel.set_xticks(range(len(days)), [f"{version}\n{date}" for date, version in days])
        panel.grid(alpha=0.3)
    panels[1].legend(fontsize="small")
    return figure


def picture(entries: Sequence[Entry], file: Path = PICTURE) -> None:
    """Draw entries into an SVG file, equal entries into equal files."""
    import matplotlib as mpl

    with mpl.rc_context({"svg.hashsalt": "history", "svg.fonttype": "none"}):
        draw(entries).savefig(file, metadata={"Date": None})


def record(*, repeats: int, file: Path = FILE, drawn: Path = PICTURE) -> Report:
    """Measure, append to a file, draw all of it, and return the table of all entries."""
    if file.exists():
        read(file)  # before the work
    append(measure(repeats=repeats), file)
    entries = read(file)
    picture(entries, drawn)
    return report(entries)
