"""Run time against error: every engine, pixel, roll and spread beside the exact range extent.

An error is sum |p - q| over sum q, of range extents p and the sampling-free ones q. Both are seen
from the slant range, so that errors are of the sampling alone.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import ladar as library
from ncti.ladar import RangeExtent
from ncti.ladar.pulse import shortest_pulse, target_kernel
from ncti.render import available_engines
from ncti.render.choice import engines
from ncti.render.view import ROLL
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Output, Stage, Table, in_memory
from sweeps.stages import run_time_tables
from sweeps.stages.apart import call_apart
from sweeps.stages.classifier import profile_vectors
from sweeps.stages.exact import RunTime, of_extents, signature_of
from sweeps.stages.ladar import Ladar
from sweeps.stages.run_time_tables import SPREAD
from sweeps.stages.views import RUN_TIME, Grid, Render, image, looks

if TYPE_CHECKING:
    import trimesh

Arrays = dict[str, NDArray[Any]]
Floats = NDArray[np.float64]
Sampling = tuple[float, float, float]  # pixel [m], roll [deg], and spread

SENSOR = GROUP = RUN_TIME
YARDSTICK, YARDSTICK_PIXEL = "embree", 0.25
VIEWS, VIEW_SETTINGS = ("ship", "aspect"), (Grid.ship, Grid.aspect)


# Samplings


@dataclass(frozen=True)
class Look:
    """Parameters of a view except its sampling; angles [deg], IFOV [rad], lengths [m]."""

    aspect: float
    depression: float
    drawn_range: float | None
    engine: str
    samples: int
    slant_range: float
    ifov: float
    bin_width: float
    window: float

    def extent(self, mesh: trimesh.Trimesh, sampling: Sampling) -> RangeExtent:
        """Draw the view by some sampling, and bin it."""
        return self.binned(self.drawn(mesh, *sampling[:2]), sampling[2])

    def drawn(self, mesh: trimesh.Trimesh, pixel: float, roll: float) -> Any:
        """Return the image, or the lines."""
        place = (self.aspect, self.depression, self.drawn_range, self.engine)
        return image(mesh, *place, pixel, self.samples, roll, ())

    def binned(self, seen: Any, spread: float) -> RangeExtent:
        """Return the range extent of an image."""
        return library.range_extent(
            seen,
            slant_range=self.slant_range,
            ifov=self.ifov,
            bin_width=self.bin_width,
            window=self.window,
            spread=spread,
        )


@in_memory(uses=(Grid, Render, Ladar), reads={"bin_width": RunTime.bin_width})
def sighting(
    aspect: float,
    depression: float,
    drawn_range: float | None,
    drawing_engine: str,
    samples: int,
    range: float,
    ifov: float,
    bin_width: float,
    window: float,
) -> Look:
    """Return the parameters common to all samplings of a view."""
    sight = (aspect, depression, drawn_range, drawing_engine, samples)
    return Look(*sight, range * 1e3, ifov * 1e-6, bin_width, window)


@of_extents(
    Output(
        "extent_error",
        label="error of the range extent of the whole ship",
        without=("pulse_width",),
    ),
    Output("ifov_error", label="error of the range extents of the IFOVs", without=("pulse_width",)),
    Output("profile_error", label="error of the range extent of the whole ship after the pulse"),
    Output("signature", ("down_range",), "f8", label="expected range profile", stored=False),
    group=GROUP,
    along=(Render.pixel, Render.roll, Ladar.spread, Grid.pulse_width),
)
def sampled(
    mesh: trimesh.Trimesh,
    sighting: Look,
    exact_ifovs: RangeExtent,
    pixel: tuple[float, ...],
    roll: tuple[float, ...],
    spread: tuple[float, ...],
    pulse_width: tuple[float, ...],
    cnr_at_range: float,
    target_free_ifovs: int,
) -> Arrays:
    """Return the errors of range extents and profiles, and expected profiles."""
    found = call_apart(sighting.engine, _extents, mesh, sighting, pixel, roll, spread)
    shape = (len(pixel), len(roll), len(spread), len(pulse_width))
    rows = []
    for extent in found:
        p, q = extent.fraction.sum(axis=0), exact_ifovs.fraction.sum(axis=0)
        whole, single = relative_error(p, q), ifov_error(extent, exact_ifovs)
        for width in pulse_width:
            kernel = target_kernel(
                pulse_width=width * 1e-9, bin_width=sighting.bin_width, bin_count=len(q)
            )
            after = relative_error(kernel**2 @ p, kernel**2 @ q)
            profile = signature_of(extent, width, cnr_at_range, target_free_ifovs)
            rows.append((whole, single, after, profile))
    names = ("extent_error", "ifov_error", "profile_error", "signature")
    columns = (np.array(column) for column in zip(*rows, strict=True))
    return {
        name: column.reshape(*shape, *column.shape[1:])
        for name, column in zip(names, columns, strict=True)
    }


def relative_error(found: Floats, exact: Floats) -> float:
    """Return the sum of absolute differences over the sum of what is exact."""
    return float(np.abs(found - exact).sum() / exact.sum())


def ifov_error(found: RangeExtent, exact: RangeExtent) -> float:
    """Return the relative error of all IFOVs, each compared with its own reference."""
    rows = {tuple(cell): row for cell, row in zip(exact.cell.tolist(), exact.fraction, strict=True)}
    wrong = 0.0
    for cell, row in zip(found.cell.tolist(), found.fraction, strict=True):
        wrong += np.abs(row - rows.pop(tuple(cell), 0.0)).sum()
    return float((wrong + sum(row.sum() for row in rows.values())) / exact.fraction.sum())


def _extents(
    mesh: trimesh.Trimesh, look: Look, pixel: Any, roll: Any, spread: Any
) -> list[RangeExtent]:
    """Range extents by every sampling, the spread fastest: each image is drawn once."""
    seen = (look.drawn(mesh, *one) for one in product(pixel, roll))
    return [look.binned(one, share) for one in seen for share in spread]


# Run times


@of_extents(
    Output(
        "run_time",
        dtype="f8",
        unit="s",
        label="run time of a view, from mesh to range extent, median of repeats",
        measured=True,
    ),
    Output(
        "ratio",
        dtype="f8",
        label="run time relative to a view by embree at 0.25 m, timed alongside",
        measured=True,
    ),
    group=GROUP,
    along=(Render.pixel, Render.roll, Ladar.spread),
)
def timed(
    mesh: trimesh.Trimesh,
    sighting: Look,
    pixel: tuple[float, ...],
    roll: tuple[float, ...],
    spread: tuple[float, ...],
    repeats: int,
) -> Arrays:
    """Return the run time of a view by every sampling, absolute and relative to a fixed one.

    Samplings take turns, forwards and backwards, so that a temporary slowdown of the machine
    affects all of them; and the reference is timed beside each pixel in every turn.
    """
    taken = call_apart(sighting.engine, _times, mesh, sighting, pixel, roll, spread, repeats)
    shape = (len(pixel), len(roll), len(spread))
    run_time, ratio = (np.median(one, axis=0).reshape(shape) for one in taken)
    return {"run_time": run_time, "ratio": ratio}


def _times(
    mesh: trimesh.Trimesh, look: Look, pixel: Any, roll: Any, spread: Any, repeats: int
) -> tuple[Floats, Floats]:
    """(turn, sampling) times [s], and ratios to the reference of the same turn and pixel."""
    standard = Look(**{**vars(look), "engine": YARDSTICK, "samples": 0})
    fixed: Sampling = (YARDSTICK_PIXEL, ROLL, SPREAD)
    samplings = list(product(pixel, roll, spread))
    look.extent(mesh, samplings[0])  # warm up: load libraries and caches of the ship
    standard.extent(mesh, fixed)
    seconds, beside = np.empty((2, repeats, len(samplings)))
    for turn in range(repeats):
        order = list(range(len(samplings)))[:: 1 if turn % 2 == 0 else -1]
        drawn = None
        for place in order:
            if samplings[place][0] != drawn:
                drawn = samplings[place][0]
                unit = _stopwatch(standard, mesh, fixed)
            seconds[turn, place] = _stopwatch(look, mesh, samplings[place])
            beside[turn, place] = unit
    return seconds, seconds / beside


def _stopwatch(look: Look, mesh: trimesh.Trimesh, sampling: Sampling) -> float:
    start = time.perf_counter()
    look.extent(mesh, sampling)
    return time.perf_counter() - start


# Decisions


@of_extents(
    Output(
        "changed",
        VIEWS,
        label="share of noisy profiles whose correlation answer differs from the exact extents'",
    ),
    group=GROUP,
    gather=VIEW_SETTINGS,
)
def changed(
    sampled: Arrays, exact_signature: Floats, profile_noise: Floats, there: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return the (ship, aspect) numbers of answers that change with the sampling."""
    found = _named(sampled["signature"], profile_noise, there)
    exact = _named(exact_signature, profile_noise, there)
    share = np.mean(found != exact, axis=-1)
    return np.where(there, share, np.nan).astype(np.float32)


def _named(signature: Floats, noise: Floats, there: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the (ship, aspect, draw) ships with the expected profile nearest to the noisy one."""
    # Imported here because scikit-learn takes a second.
    from ncti.classify.baselines import CorrelationNeighbour

    ship, known = np.indices(there.shape)[0].ravel(), there.ravel()
    neighbour = CorrelationNeighbour().fit(profile_vectors(signature)[known], ship[known])
    noisy = np.moveaxis(signature[..., None, :] + noise, -2, 0)  # draws lead
    vectors = profile_vectors(noisy)
    names = neighbour.predict(vectors.reshape(-1, vectors.shape[-1]))
    return np.moveaxis(names.reshape(-1, *there.shape), 0, -1)


# Checks


def check(choices: Choices) -> Choices:
    """Drop unavailable engines, and refuse what cannot be measured."""
    if not looks(SENSOR)(choices):
        return choices
    tolerance = next((one for one in choices[Render.tolerance] if one is not None), None)
    if tolerance is not None:
        raise ConfigurationError(
            f"render.tolerance has {tolerance:g}, but must be null with the sensor {SENSOR}, which "
            "measures the error of a given pixel"
        )
    window = choices.one(Ladar.window)
    for bin_width in choices[RunTime.bin_width]:
        shortest = shortest_pulse(bin_width) * 1e9
        if window < 10 * bin_width:
            raise ConfigurationError(
                f"run_time.bin_width has {bin_width:g}, but must be at most a tenth of "
                f"ladar.window, {window:g} m"
            )
        if min(choices[Grid.pulse_width]) < shortest:
            raise ConfigurationError(
                f"grid.pulse_width has {min(choices[Grid.pulse_width]):g}, but must be at least "
                f"{shortest:.3g} for run_time.bin_width {bin_width:g} m"
            )
    widest = max(choices[Render.pixel])
    narrowest = min(choices[Ladar.ifov]) * min(choices[Grid.range]) * 1e-3
    if narrowest < widest:
        raise ConfigurationError(
            f"render.pixel has {widest:g}, but must be at most {narrowest:.3g} m, the width of an "
            "IFOV"
        )
    asked, absent = choices[Render.engine], missing_engines()
    here = tuple(one for one in asked if one not in absent)
    return choices.having(Render.engine, here or asked)


def missing_engines() -> list[str]:
    """Return the engines whose libraries this machine lacks."""
    return [name for name in engines() if name not in available_engines()]


def remarks(choices: Choices) -> list[str]:
    """Return a sentence for each engine that is not measured because its libraries are missing."""
    missing = missing_engines() if looks(SENSOR)(choices) else []
    return [
        f"render.engine is measured without {name}: its libraries are missing" for name in missing
    ]


STAGES: tuple[Stage, ...] = (sighting, sampled, timed, changed)
TABLES = (
    Table(f"tables/{GROUP}", (GROUP,), run_time_tables.tabulate_nominal, looks(SENSOR)),
    Table(f"tables/{GROUP}_cost", (GROUP,), run_time_tables.tabulate_cost, looks(SENSOR)),
    Table(f"tables/{GROUP}_samplings", (GROUP,), run_time_tables.tabulate, looks(SENSOR)),
)
