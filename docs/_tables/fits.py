"""Parameters fitted to the article's figures, and checked against its other figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from benchmarks.reports import Column, Report
from docs._tables.sweeping import sweep_groups
from ncti.article import article_figures
from ncti.classify import Similarities, cluster
from ncti.evaluate import aspect_bins
from ncti.features import profile_vector

GROUPS = ("0-27°", "30-57°", "60-90°")
FRAMES = (32, 16, 8, 4)  # the rows of the article's Tables 2 and 4
VIEW = ("ship", "aspect")
DRAW_DIMS = ("seed", "replicate", "phase", "order", "draw")

DRAWS = ("grid.replicate=2", "seed=[0,1,2,3]")
MNN = ("classifier=mnn", "grid.replicate=2", "seed=[0,1,2,3,4,5,6,7]")
TOLERANCES = (0.1, 0.3, 0.35, 0.4)
ACN = ("classifier.name=[acn,mnn]", "grid.pulse_width=[10,30,50]", *DRAWS)
TARGET_FREE = (0, 1000, 2000, 4000, 6000, 16000)
INFRARED = ("sensor=infrared", "infrared.frame_count=16", "infrared.vigilance=0.87")
RADII = (0.4, 0.45, 0.5, 0.55, 0.6, 0.7)
RATES = (0.03, 0.1, 0.3)
ORDERS = 24

Floats = NDArray[np.float64]


def percent(correct: xr.DataArray) -> xr.DataArray:
    """Return the (..., group) percentage of (..., ship, aspect) answers that are right.

    Views with a negative answer do not count.
    """
    labels, index = aspect_bins(correct.aspect.values)
    right = xr.where(correct >= 0, 100.0 * (correct == 1), np.nan)
    of_bins = [right.isel(aspect=index == k).mean(VIEW) for k in range(len(labels))]
    return xr.concat(of_bins, "group").transpose(..., "group")


def overall_percent(correct: xr.DataArray) -> xr.DataArray:
    """Return the percentage of right answers, (ship, aspect) pooled."""
    return xr.where(correct >= 0, 100.0 * (correct == 1), np.nan).mean(VIEW)


def mean_and_error(draws: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray]:
    """Return the mean over all draws, and its standard error.

    Draws of several kinds are crossed, such as phases on the detector and orders of presentation:
    the variance is the sum over kinds of the variance of its means, over their number.
    """
    kinds = [dim for dim in DRAW_DIMS if draws.sizes.get(dim, 1) > 1]
    variance = xr.zeros_like(draws.mean(kinds))
    for kind in kinds:
        of_kind = draws.mean([dim for dim in kinds if dim != kind])
        variance = variance + of_kind.var(kind, ddof=1) / draws.sizes[kind]
    return draws.mean(kinds), variance**0.5


@dataclass(frozen=True)
class Part:
    """Some figures of the article, and ours for every value of a parameter.

    Attributes
    ----------
    name : str
        Heading.
    ours : DataArray
        Percent, along the parameter, draws, and the dimensions of the article's figures.
    source : array_like
        The article's figures, in percent.
    over : tuple of str
        Dimensions of the article's figures.
    """

    name: str
    ours: xr.DataArray
    source: ArrayLike
    over: tuple[str, ...] = ("group",)

    def distance(self, parameter: str) -> tuple[Floats, Floats]:
        """Return root mean square distances for every value of the parameter.

        First from the mean to the article, then the expected distance of one draw to the mean.
        """
        source = xr.DataArray(np.asarray(self.source, dtype=np.float64), dims=self.over)
        draws = [dim for dim in DRAW_DIMS if dim in self.ours.dims]
        distance = ((self.ours.mean(draws) - source) ** 2).mean(self.over) ** 0.5
        single = self.ours.var(draws, ddof=1).mean(self.over) ** 0.5
        return distance.transpose(parameter).values, single.transpose(parameter).values


def fit_rows(
    parameter: str, default: float, parts: Sequence[Part], other_figures: Mapping[str, xr.DataArray]
) -> list[dict[str, Any]]:
    """Return a row for every value of a parameter, with a star at the best of each part.

    Parameters
    ----------
    parameter : str
        Its dimension.
    default : float
        Value in the project's settings, which is labelled.
    parts : sequence of Part
        Figures to compare.
    other_figures : mapping of str to DataArray
        Further figures by heading, with draws: their mean and two standard errors.
    """
    values = parts[0].ours[parameter].values
    rows: list[dict[str, Any]] = [
        {"value": f"{value:g}" + (" (default)" if value == default else "")} for value in values
    ]
    for part in parts:
        distance, single = part.distance(parameter)
        for k, row in enumerate(rows):
            best = " *" if k == distance.argmin() else ""
            row[part.name] = f"{distance[k]:.1f} ({single[k]:.1f}){best}"
    for name, draws in other_figures.items():
        mean, error = mean_and_error(draws.transpose(parameter, ...))
        for row, middle, spread in zip(rows, mean.values, error.values, strict=True):
            row[name] = format_errors(middle, spread)
    return rows


def format_errors(mean: ArrayLike, error: ArrayLike) -> str:
    """Return figures with two standard errors, separated by slashes."""
    pairs = zip(np.atleast_1d(mean), np.atleast_1d(error), strict=True)
    return " / ".join(f"{middle:.0f} ± {2 * spread:.0f}" for middle, spread in pairs)


def fit_report(
    title: str, overrides: Sequence[str], heading: str, rows: list[dict[str, Any]], notes: list[str]
) -> Report:
    """Return the report of a fit, with the columns of its rows."""
    names = [name for name in rows[0] if name != "value"]
    columns = (Column("value", heading), *(Column(name, name) for name in names))
    return Report(title, columns, rows, [f"`ncti-sweep {' '.join(overrides)}`. {notes[0]}"])


DISTANCES = (
    "Root mean square distance to the article's figures [points], in brackets that of a single "
    "draw from the mean; * the smallest of a column. Others: percent correct ± two standard "
    "errors of the mean over draws. "
)


def tolerance(overrides: Sequence[str] = MNN, values: Sequence[float] = TOLERANCES) -> Report:
    """Fit the MNN tolerance to Table 2's training rows, and judge it by its test rows."""
    arguments = [*overrides, f"classifier.mnn.tolerance=[{','.join(map(str, values))}]"]
    answers = sweep_groups(arguments, ["classification/mnn"])["classification/mnn"]
    table = article_figures()["table2_percent_correct"]
    answers = answers.squeeze(drop=True)
    trained, tested = percent(answers.training_correct), percent(answers.correct)
    counts = [count for count in FRAMES if count in answers.frame_count]
    parts = [
        Part("training, fitted", trained, table["training"]),
        *(
            Part(f"{count} frames", tested.sel(frame_count=count), table["frames"][count])
            for count in counts
        ),
    ]
    other_percentages = {
        "training [%]": trained,
        "16 frames [%]": tested.sel(frame_count=16),
    }
    source = f"{table['training']}, 16 frames {table['frames'][16]}"
    return fit_report(
        "MNN tolerance: fitted to the training row of Table 2, judged by its test rows",
        arguments,
        "tolerance",
        fit_rows("tolerance", 0.35, parts, other_percentages),
        [f"{DISTANCES}A seed is another training. Source, by bin: training {source}."],
    )


def target_free(overrides: Sequence[str] = ACN, values: Sequence[float] = TARGET_FREE) -> Report:
    """Fit target-free IFOVs to 32 frames near the bow, and judge by the rest of Tables 2 and 4."""
    arguments = [
        *overrides,
        "classifier.learn_in_test=true",
        f"ladar.target_free_ifovs=[{','.join(map(str, values))}]",
    ]
    groups = ("classification/acn", "classification/mnn", "tables/acn")
    acn, mnn, table3 = sweep_groups(arguments, groups).values()
    figures = article_figures()
    counts = [count for count in FRAMES if count in acn.frame_count]
    parts, other_percentages = [], {}
    for name, answers, table in (
        ("ACN", acn, figures["table4_percent_correct"]),
        ("MNN", mnn, figures["table2_percent_correct"]),
    ):
        score = percent(answers.correct.squeeze(drop=True)).sel(frame_count=counts)
        at_30 = score.sel(pulse_width=30)
        printed = np.array([table["frames"][count] for count in counts], dtype=np.float64)
        fitted = f"{name} bow, {counts[0]} frames, fitted"
        parts.append(Part(fitted, at_30.isel(group=0, frame_count=0), printed[0, 0], ()))
        bow = at_30.isel(group=0, frame_count=slice(1, None))
        dims = ("frame_count",)
        parts.append(Part(f"{name} bow, fewer frames", bow, printed[1:, 0], dims))
        for group in (1, 2):
            of_group = at_30.isel(group=group)
            parts.append(Part(f"{name} {GROUPS[group]}", of_group, printed[:, group], dims))
        other_percentages[f"{name} bow, 16 frames, 10 / 30 / 50 ns [%]"] = score.isel(group=0).sel(
            frame_count=16
        )
    formed = table3.category_count.squeeze(drop=True).transpose("pulse_width", ...).values
    by_g = formed.reshape(3, -1)
    note = "the same for every G" if (by_g == by_g[:, :1]).all() else "not the same for every G"
    return fit_report(
        "G, target-free IFOVs a frame: fitted to 32 frames near the bow, judged by the rest",
        arguments,
        "G",
        fit_rows("target_free_ifovs", 4000, parts, other_percentages),
        [
            f"{DISTANCES}Categories at 10, 30 and 50 ns are "
            f"{', '.join(map(str, by_g[:, 0]))}, {note}. Source near the bow, 16 frames, 30 ns: "
            "78 %, at 10 and 50 ns 'similar'."
        ],
    )


def inner_radius(overrides: Sequence[str] = INFRARED, values: Sequence[float] = RADII) -> Report:
    """Fit the inner radius of the log-polar map at 25 km of Table 5, and judge it at 50 km."""
    arguments = [
        *overrides,
        "classifier.learn_in_test=true",
        "grid.range=[25,50]",
        "infrared.super_resolution=[none,perfect]",
        f"infrared.inner_radius=[{','.join(map(str, values))}]",
    ]
    groups = ("classification/acn_infrared", "tables/acn_infrared")
    answers, formed = sweep_groups(arguments, groups).values()
    table = article_figures()["table5_percent_correct"]
    score = percent(answers.correct.squeeze(drop=True))
    looks = {
        "25 km, fitted": ("none", 25),
        "50 km": ("none", 50),
        "50 km, perfect 2x": ("perfect", 50),
    }
    scores = {
        name: score.sel(super_resolution=way, range=km).drop_vars(["super_resolution", "range"])
        for name, (way, km) in looks.items()
    }
    parts = [Part(name, scores[name], table[way][km]) for name, (way, km) in looks.items()]
    rows = fit_rows("inner_radius", 0.5, parts, {f"{name} [%]": scores[name] for name in looks})
    of_radius = formed.category_count.squeeze(drop=True).transpose("inner_radius", ...).values
    for row, counts in zip(rows, of_radius, strict=True):
        row["categories"] = f"{counts.mean():.1f} ({counts.min()}–{counts.max()})"
    printed = ", ".join(f"{name} {table[way][km]}" for name, (way, km) in looks.items())
    return fit_report(
        "Inner radius of the log-polar map: fitted at 25 km of Table 5, judged at 50 km",
        arguments,
        "radius",
        rows,
        [f"{DISTANCES}Source, by bin: {printed}; {table['categories']} categories."],
    )


def learning_rate(values: Sequence[float] = RATES, orders: int = ORDERS) -> Report:
    """Fit the learning rate at 30 ns of Table 3, and judge it at 10 and 50 ns, by order."""
    arguments = ("grid.pulse_width=[10,30,50]", "grid.frame_count=16")
    profiles = sweep_groups(arguments, ["range_profile"])["range_profile"]
    table = article_figures()["table3_categories"]
    rng, views = np.random.default_rng(0), profiles.sizes["ship"] * profiles.sizes["aspect"]
    turns = [np.arange(views), *(rng.permutation(views) for _ in range(orders))]
    rows: list[dict[str, Any]] = [
        {"value": f"{rate:g}" + (" (default)" if rate == 0.1 else "")} for rate in values
    ]
    for pulse in profiles.pulse_width.values:
        expected = profiles.expected.squeeze().sel(pulse_width=pulse).transpose(*VIEW, ...).values
        similarities = Similarities.of(profile_vector(expected.reshape(views, -1)))
        for row, rate in zip(rows, values, strict=True):
            options = {"vigilance": table["vigilance"], "learning_rate": rate}
            of_grid, *shuffled = (
                int(cluster(similarities, **options, order=turn).labels.max()) + 1 for turn in turns
            )
            text = f"{of_grid}; {np.mean(shuffled):.1f} ({min(shuffled)}–{max(shuffled)})"
            row[f"{pulse:g} ns (source {table['categories'][int(pulse)]})"] = text
    return Report(
        "Categories of Table 3 by learning rate",
        (Column("value", "learning rate"), *(Column(n, n) for n in rows[0] if n != "value")),
        rows,
        [
            "`ncti-sweep grid.pulse_width=[10,30,50] grid.frame_count=16`. Categories formed at a "
            f"vigilance of {table['vigilance']:g} in the grid's own order of presentation; then "
            f"mean (least–most) of {orders} random orders."
        ],
    )
