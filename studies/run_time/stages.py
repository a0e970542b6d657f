"""Run time against error: every engine, pixel, roll and spread beside the exact range extent.

An error is sum |p - q| over sum q, of range extents p and the sampling-free ones q. Both are seen
from the slant range, so that errors are of the sampling alone.
"""

from __future__ import annotations

import time
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.labels import labelled_dataset
from ncti.ladar import RangeExtent, expected_profile, range_extent
from ncti.render import LineImage, RangeImage, Sampling, available_engines
from ncti.render.choice import engines
from ncti.render.view import ROLL
from studies.run_time.subprocess_call import call_in_process
from sweeps.engine.declare.settings import Choices, Settings, count
from sweeps.engine.declare.stage import (
    MEASURED,
    Group,
    Output,
    Stream,
    derived,
    in_memory,
    inner,
    stage,
)
from sweeps.stages import views
from sweeps.stages.arguments import Keywords, keywords, restore
from sweeps.stages.classifier import profile_vectors
from sweeps.stages.correlation import match_views
from sweeps.stages.ladar import BEAM, EXTENT, SIGNAL, Ladar, check_profiles, check_pulses
from sweeps.stages.refusals import refuse, require
from sweeps.stages.views import Arrays, Floats, Grid, Render, uses_sensor

if TYPE_CHECKING:
    import trimesh
    import xarray as xr

SENSOR = "run_time"
CONF = Path(__file__).with_name("conf")
IMPORTS = ("studies.run_time.accuracy",)
VIEWS, VIEW_SETTINGS = ("ship", "aspect"), (Grid.ship, Grid.aspect)
SPREAD, BIN_WIDTH = 0.5, 1.0
STANDARD = Sampling("embree", 0.25, 0, ROLL)  # of the views that others are timed beside
TARGET = 1e-3  # error whose cost is tabulated


class RunTime(Settings, key="run_time"):
    """Run time against error."""

    bin_width = views.quantity(
        1, 0.05, 50, "m", "range bin of the extents that are timed", role="dimension"
    )
    repeats = count(3, 1, 1000, label="timings of a view, of which the median is taken")
    draws = count(
        16, 1, 1000, label="noisy profiles of a view that are classified", not_swept=views.SHAPES
    )


USED = (Grid, Render, Ladar, RunTime)
TIMED = Group(SENSOR, uses_sensor(SENSOR), USED, status=views.STATUS)
_signature = inner("signature", ("down_range",), "f8")
_measured = partial(Output, dtype="f8", role=MEASURED)
VIEW = {"aspect": Grid.aspect, "depression": "depression"}
BINNED = {name: BEAM[name] for name in ("slant_range", "ifov", "window")}
BINNED["bin_width"] = RunTime.bin_width


# Exact results


@stage(*EXTENT, uses=USED, reads=VIEW | BINNED)
def exact_extent(mesh: trimesh.Trimesh, **view: Any) -> Arrays:
    """Return the visible areas of the sampling-free reference, bin by range bin."""
    from studies.run_time.accuracy import exact_extent

    return exact_extent(mesh, **view).packed()


@in_memory()
def exact_ifovs(exact_extent: Arrays) -> RangeExtent:
    """Return the exact extent as a `RangeExtent`."""
    return restore(RangeExtent.unpacked, exact_extent)


exact_signature = stage(
    _signature, reads=SIGNAL | {"extent": "exact_ifovs"}, name="exact_signature"
)(expected_profile)


@stage(
    Output("noise", ("draw", "down_range"), "f8"),
    uses=USED,
    reads=SIGNAL | {"frame_count": Grid.frame_count},
    stream=Stream((Grid.ship, Grid.aspect, Grid.pulse_width, RunTime.bin_width)),
)
def profile_noise(
    exact_ifovs: RangeExtent, draws: int, rng: np.random.Generator, **signal: Any
) -> Floats:
    """Return draws of the deviation of averaged frames from their expectation."""
    from studies.run_time.accuracy import profile_noise

    return profile_noise(exact_ifovs, draws=draws, rng=rng, **signal)


# Samplings


timed_view = derived(reads=VIEW | {"slant_range": "drawn_range"}, name="timed_view")(keywords)
timed_beam = derived(reads=BINNED, name="timed_beam")(keywords)


@in_memory()
def timed_image(
    mesh: trimesh.Trimesh, sampling: Sampling, timed_view: Keywords
) -> RangeImage | LineImage:
    """Return the image of a sampling."""
    return call_in_process(sampling.engine, sampling.draw, mesh, **dict(timed_view))


@TIMED.stage(
    Output("extent_error", label="error of the ship's range extent", without=("pulse_width",)),
    Output("ifov_error", label="error of the range extents of the IFOVs", without=("pulse_width",)),
    Output("profile_error", label="error of the range extent of the ship after the pulse"),
    _signature,
    reads=SIGNAL,
)
def sampled(
    timed_image: RangeImage | LineImage,
    timed_beam: Keywords,
    exact_ifovs: RangeExtent,
    spread: float,
    pulse_width: float,
    **signal: Any,
) -> dict[str, Any]:
    """Return the errors of a range extent and of its profile, and the expected profile."""
    from studies.run_time.accuracy import extent_errors

    extent = range_extent(timed_image, spread=spread, **dict(timed_beam))
    errors = extent_errors(extent, exact_ifovs, pulse_width=pulse_width)
    return errors | {"signature": expected_profile(extent, pulse_width=pulse_width, **signal)}


# Run times


@TIMED.stage(
    _measured("run_time", label="run time from mesh to range extent, median of repeats", unit="s"),
    _measured("ratio", label="run time relative to a view by embree at 0.25 m, timed alongside"),
    reads={"engine": "drawing_engine"},
    along=(Render.pixel, Render.roll, Ladar.spread),
)
def timed(
    mesh: trimesh.Trimesh,
    timed_view: Keywords,
    timed_beam: Keywords,
    engine: str,
    samples: int,
    *,
    pixel: tuple[float, ...],
    roll: tuple[float, ...],
    spread: tuple[float, ...],
    repeats: int,
) -> Arrays:
    """Return the run time of a view by every sampling, absolute and relative to a fixed one.

    Samplings take turns, forwards and backwards, so that a temporary slowdown of the machine
    affects all of them; and the reference is timed beside each pixel in every turn.
    """
    samplings = [
        (Sampling(engine, side, samples, angle), share)
        for side, angle, share in product(pixel, roll, spread)
    ]
    measurements = call_in_process(engine, _times, mesh, samplings, repeats, timed_view, timed_beam)
    shape = len(pixel), len(roll), len(spread)
    run_time, ratio = (np.median(times, axis=0).reshape(shape) for times in measurements)
    return {"run_time": run_time, "ratio": ratio}


def _times(
    mesh: trimesh.Trimesh,
    samplings: list[tuple[Sampling, float]],
    repeats: int,
    view: Keywords,
    beam: Keywords,
) -> tuple[Floats, Floats]:
    """Return (turn, sampling) times [s] and ratios to the reference of the same turn and pixel."""

    def stopwatch(sampling: Sampling, spread: float) -> float:
        start = time.perf_counter()
        range_extent(sampling.draw(mesh, **dict(view)), spread=spread, **dict(beam))
        return time.perf_counter() - start

    for sampling in (samplings[0], (STANDARD, SPREAD)):
        stopwatch(*sampling)  # warm up: load libraries and caches of the ship
    seconds, beside = np.empty((2, repeats, len(samplings)))
    for turn in range(repeats):
        pixel = None
        for index in list(range(len(samplings)))[:: 1 if turn % 2 == 0 else -1]:
            if samplings[index][0].pixel != pixel:
                pixel = samplings[index][0].pixel
                standard = stopwatch(STANDARD, SPREAD)
            seconds[turn, index] = stopwatch(*samplings[index])
            beside[turn, index] = standard
    return seconds, seconds / beside


# Decisions


@TIMED.stage(
    Output(
        "changed",
        VIEWS,
        label="share of noisy profiles whose correlation answer differs from the exact extents'",
    ),
    gather=VIEW_SETTINGS,
)
def changed(
    sampled: Arrays, exact_signature: Floats, profile_noise: Floats, valid: NDArray[np.bool_]
) -> Floats:
    """Return the (ship, aspect) shares of answers that change with the sampling."""

    def predict(signature: Floats) -> NDArray[np.integer]:
        noisy = np.moveaxis(signature[..., None, :] + profile_noise, -2, 0)  # draws lead
        vectors, templates = map(profile_vectors, (noisy, signature))
        answers = (
            match_views(templates[None], vector, valid, valid, left_out=False) for vector in vectors
        )
        return np.array([answer["predicted"] for answer in answers])

    differ = predict(sampled["signature"]) != predict(exact_signature)
    return np.where(valid, differ.mean(axis=0), np.nan)


# Checks


def check(choices: Choices) -> Choices | None:
    """Drop unavailable engines, and refuse settings that cannot be measured."""
    if not uses_sensor(SENSOR)(choices):
        return None
    check_profiles(choices)
    reason = f"with the sensor {SENSOR}, which measures the error of a given pixel"
    require(choices, Render.tolerance, None, reason)
    window, widest_bin = choices.value(Ladar.window), max(choices[RunTime.bin_width])
    if window < 10 * widest_bin:
        refuse(RunTime.bin_width, widest_bin, f"at most a tenth of ladar.window, {window:g} m")
    check_pulses(choices, RunTime.bin_width)
    widest = max(choices[Render.pixel])
    beam, nearest = min(choices[Ladar.ifov]), min(choices[Grid.range])
    narrowest = Ladar.ifov.in_si(beam) * Grid.range.in_si(nearest)
    if narrowest < widest:
        refuse(Render.pixel, widest, f"at most {narrowest:.3g} m, the width of an IFOV")
    requested, absent = choices[Render.engine], missing_engines()
    return choices.replace(
        Render.engine, tuple(e for e in requested if e not in absent) or requested
    )


def missing_engines() -> list[str]:
    """Return the engines whose libraries this machine lacks."""
    return [name for name in engines() if name not in available_engines()]


def about(choices: Choices) -> list[str]:
    """Return a sentence for each engine that is not measured because its libraries are missing."""
    missing = missing_engines() if uses_sensor(SENSOR)(choices) else []
    return [
        f"render.engine is measured without {name}: its libraries are missing" for name in missing
    ]


# Tables


def tabulate(measured: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return median and worst of all views, for every engine and sampling."""
    import xarray as xr

    def reduce_views(names: list[str], suffix: str, word: str, reduce: Any) -> xr.Dataset:
        reduced = reduce(measured[names].astype("f8"), VIEWS, keep_attrs=True)
        for array in reduced.data_vars.values():
            array.attrs["long_name"] += f", {word} of views"
        return reduced.rename({name: name + suffix for name in names})

    errors = ["extent_error", "ifov_error", "profile_error"]
    parts = (
        reduce_views(["run_time", "ratio"], "", "median", xr.Dataset.median),
        reduce_views(errors, "_median", "median", xr.Dataset.median),
        reduce_views(errors, "_worst", "worst", xr.Dataset.max),
        reduce_views(["changed"], "", "mean", xr.Dataset.mean),
    )
    return xr.merge(parts).assign_attrs(title="Run time against error, all samplings")


def tabulate_nominal(measured: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the table by engine and pixel, at the default sampling or the nearest to it."""
    table = tabulate(measured, choices)
    nominal = {"roll": ROLL, "spread": SPREAD, "bin_width": BIN_WIDTH}
    selection = {name: value for name, value in nominal.items() if name in table.dims}
    return table.sel(selection, method="nearest").assign_attrs(title="Run time against error")


def tabulate_cost(measured: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the time, ratio and pixel at which the median profile error is `TARGET`, by engine."""
    import xarray as xr

    table = tabulate_nominal(measured, choices)
    if "pixel" not in table.dims:
        table = table.expand_dims("pixel")
    figures = {
        "run_time": ("time of a view of that error", "s"),
        "ratio": ("that time over a view by embree at 0.25 m, timed alongside", "1"),
        "pixel": ("pixel of that error", "m"),
    }
    along: Any = {"input_core_dims": [["pixel"], ["pixel"]], "vectorize": True}
    error = table.profile_error_median
    needed = {
        f"{name}_needed": (xr.apply_ufunc(figure_at_target, table[name], error, **along), *label)
        for name, label in figures.items()
    }
    return labelled_dataset(needed).assign_attrs(title=f"Cost of a median error of {TARGET:.1%}")


def figure_at_target(figure: Floats, error: Floats) -> float:
    """Return a figure where the error is `TARGET`, by the power law between the pixels around it.

    Return the coarsest pixel's figure if all errors are smaller, and NaN if all are larger or one
    is unknown.
    """
    order = np.argsort(error)
    if not (np.isfinite(error).all() and np.isfinite(figure).all()) or error[order[0]] > TARGET:
        return np.nan
    floor = np.finfo(np.float64).tiny  # errors may be 0, which has no logarithm
    x, y = np.log(np.maximum(error[order], floor)), np.log(figure[order])
    return float(np.exp(np.interp(np.log(TARGET), x, y)))


STAGES = (
    exact_extent,
    exact_ifovs,
    exact_signature,
    profile_noise,
    timed_view,
    timed_beam,
    timed_image,
    sampled,
    timed,
    changed,
)
TABLES = (
    TIMED.table("run_time", tabulate_nominal),
    TIMED.table("run_time_cost", tabulate_cost),
    TIMED.table("run_time_samplings", tabulate),
)
