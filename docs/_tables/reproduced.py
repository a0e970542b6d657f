"""The article's tables over its unstated parameters: fits, checks and ranges."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.reports import Column, Report
from docs._tables.proof import LoneSetting, prove_sweep
from docs._tables.sweeping import choices_of, sweep_groups
from studies.reproduction.assumptions import PRIORS, Choice
from studies.reproduction.fits import FITS
from studies.reproduction.stages import Reproduce

EXPERIMENT = ("+experiment=reproduce",)
PARTIAL_SWEEP = (*EXPERIMENT, "reproduce.setting=256")
MAX_DEVIATIONS = 2.0  # standard deviations
LISTED_FITS = ("2, 3", "4, 5", "all")  # fits whose parameters are listed
MAX_PARAMETERS = 6  # parameters, those that posteriors say most of
CATEGORIES = {
    "Table 3, categories": "Table 3, categories at 10 / 30 / 50 ns",
    "Table 5": "Table 5, categories",
}


def lone_settings(count: int = 16) -> Iterator[LoneSetting]:
    """Yield random settings: the first setting of other seeds."""
    for seed in range(1, count + 1):
        yield LoneSetting((*EXPERIMENT, "reproduce.setting=1", f"seed={seed}"))


def measure(
    overrides: Sequence[str] = EXPERIMENT, part: Sequence[str] = PARTIAL_SWEEP
) -> dict[str, Report]:
    """Return the reports of a sweep of settings: its figures, fits, parameters and engine.

    The report of the engine computes part of the settings anew.
    """
    names = ("reproduction", "reproduction_fits", "reproduction_parameters")
    groups = ("reproduction", *(f"tables/{name}" for name in names))
    settings, figures, fits, parameters = sweep_groups(overrides, groups).values()
    _, engine = prove_sweep(
        part, groups[:1], len(choices_of(part)[Reproduce.setting]), lone_settings()
    )
    command = f"`ncti-sweep {' '.join(overrides)}`, {fits.sizes['setting']} settings."
    return {
        "engine": engine,
        "figures": figure_report(figures, command),
        "fits": fit_report(fits, figures.sizes["figure"], command),
        "parameters": parameter_report(parameters, fits, settings),
    }


def figure_report(figures: xr.Dataset, command: str) -> Report:
    """Return the article's figures by rows of its tables, bins separated by slashes."""
    rows: list[dict[str, Any]] = []
    names = [str(name).rpartition(", ")[0] for name in figures.figure.values]
    for name in dict.fromkeys(names):
        row_figures = figures.isel(
            figure=[k for k, table_row in enumerate(names) if table_row == name]
        )
        row = {
            "what": CATEGORIES.get(name, name),
            "article": join_slashed(row_figures.article.values),
            "range": join_slashed(
                zip(row_figures.least.values, row_figures.largest.values, strict=True)
            ),
            "agreeing": join_slashed(100 * row_figures.agreeing.values),
            "nearest": join_slashed(row_figures.nearest.values, ".1f"),
        }
        for fit in LISTED_FITS:
            fitted = row_figures.sel(fitted=fit)
            ends = zip(fitted.percent_low.values, fitted.percent_high.values, strict=True)
            row[fit] = f"{join_slashed(fitted.percent.values)} ({join_slashed(ends)})"
        rows.append(row)
    return Report(
        "The article's figures beside those of settings",
        (
            Column("what", "figure"),
            Column("article", "article"),
            Column("range", "all settings"),
            Column("agreeing", "settings that agree [%]"),
            Column("nearest", "nearest [σ]"),
            *(Column(fit, f"fitted to {fit}") for fit in LISTED_FITS),
        ),
        rows,
        [
            f"{command} Percent correct, by bin. All settings: least–largest mean of their draws. "
            f"A setting agrees within {MAX_DEVIATIONS:g} standard deviations, binomial ones of as "
            "many views as the article's and those of our mean. Fitted: mean of the posterior, and "
            "its middle 95 %."
        ],
    )


def fit_report(fits: xr.Dataset, figures: int, command: str) -> Report:
    """Return the distances to each table, by the tables that settings are fitted to."""
    rows = [
        {
            "fitted": "none (prior)" if fit == "none" else fit,
            **{
                f"table_{table}": f"{float(fitted.distance.sel(table=table)):.1f}"
                f" ({float(fitted.best.sel(table=table)):.1f})"
                + ("" if table in FITS[fit] else " *" if fit != "none" else "")
                for table in fitted.table.values.tolist()
            },
            "temperature": f"{float(fitted.temperature):.1f}",
            "effective": f"{float(fitted.effective):.0f}",
        }
        for fit in FITS
        for fitted in [fits.sel(fitted=fit)]
    ]
    minima = ", ".join(f"{value:.1f}" for value in fits.least.values)
    return Report(
        "Chi-square per figure of each table",
        (
            Column("fitted", "fitted to tables"),
            *(Column(f"table_{t}", f"table {t}") for t in fits.table.values.tolist()),
            Column("temperature", "variances times"),
            Column("effective", "effective settings"),
        ),
        rows,
        [
            f"{command} Mean of the posterior; in brackets the setting of the largest weight; * "
            f"tables that it is not fitted to. The least of all settings: {minima}. One setting "
            f"agrees with at most {int(fits.together)} of {figures} figures."
        ],
    )


def parameter_report(parameters: xr.Dataset, fits: xr.Dataset, settings: xr.Dataset) -> Report:
    """Return the parameters with the most informative posteriors."""
    information = parameters.information.sel(fitted=list(LISTED_FITS))
    largest = information.max("fitted")
    names = largest.sortby(largest, ascending=False).parameter.values[:MAX_PARAMETERS]
    rows: list[dict[str, Any]] = []
    for name in map(str, names):
        prior, posteriors = PRIORS[name], parameters.sel(parameter=name)
        row = {"what": f"{prior.group}: {prior.label}"}
        if isinstance(prior, Choice):
            row["prior"] = ", ".join(map(str, prior.values)).replace("_", " ")
        else:
            row["prior"] = f"{format_number(prior.low)}–{format_number(prior.high)}"
        for fit in LISTED_FITS:
            posterior = posteriors.sel(fitted=fit)
            median, low, high = (
                float(posterior[key]) for key in ("median", "median_low", "median_high")
            )
            if isinstance(prior, Choice):
                choices = settings.value.sel(parameter=name, setting=fits.setting).values
                share = np.bincount(choices.astype(int), fits.weight.sel(fitted=fit).values)
                word = str(prior.values[int(share.argmax())]).replace("_", " ")
                text = f"{word} {100 * share.max():.0f} %"
            else:
                text = f"{format_number(median)} ({format_number(low)}–{format_number(high)})"
            row[fit] = f"{text}; {float(posterior.information):.2f} bit"
        rows.append(row)
    return Report(
        "Parameters that the article's tables say most of",
        (
            Column("what", "parameter"),
            Column("prior", "prior"),
            *(Column(fit, f"fitted to {fit}") for fit in LISTED_FITS),
        ),
        rows,
        [
            "Median of the posterior and its middle 95 %, or its most probable word; information "
            "on the prior. All parameters are in the picture."
        ],
    )


def join_slashed(values: Iterable[Any], spec: str = ".0f") -> str:
    """Return numbers, or pairs of them, separated by slashes."""
    return " / ".join(
        "–".join(f"{end:{spec}}" for end in np.atleast_1d(np.asarray(value, dtype=float)))
        for value in values
    )


def format_number(value: float) -> str:
    """Return a number with three digits, at least to the unit."""
    return f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"
