"""The article's tables over what it leaves open: what is fitted, judged and reached."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.reports import Column, Report
from docs._tables.proof import Alone, proven
from docs._tables.sweeping import choices_of, swept
from studies.reproduction import FITS, PRIORS, Choice
from studies.reproduction.stages import Reproduce

EXPERIMENT = ("+experiment=reproduce",)
PART = (*EXPERIMENT, "reproduce.setting=256")
AGREES = 2.0  # standard deviations
SHOWN = ("2, 3", "4, 5", "all")  # fits whose parameters are listed
LISTED = 6  # parameters, those that posteriors say most of
CATEGORIES = {
    "Table 3, categories": "Table 3, categories at 10 / 30 / 50 ns",
    "Table 5": "Table 5, categories",
}


def settings_alone(count: int = 16) -> Iterator[Alone]:
    """Yield settings at random: the first ones of other seeds."""
    for seed in range(1, count + 1):
        yield Alone((*EXPERIMENT, "reproduce.setting=1", f"seed={seed}"))


def measure(overrides: Sequence[str] = EXPERIMENT, part: Sequence[str] = PART) -> dict[str, Report]:
    """Return the reports of a sweep of settings: its figures, fits, parameters and engine.

    Of the engine, part of the settings are computed anew.
    """
    names = ("reproduction", "reproduction_fits", "reproduction_parameters")
    groups = ("reproduction", *(f"tables/{name}" for name in names))
    settings, figures, fits, parameters = swept(overrides, groups).values()
    _, engine = proven(part, groups[:1], len(choices_of(part)[Reproduce.setting]), settings_alone())
    command = f"`ncti-sweep {' '.join(overrides)}`, {fits.sizes['setting']} settings."
    return {
        "engine": engine,
        "figures": of_figures(figures, command),
        "fits": of_fits(fits, figures.sizes["figure"], command),
        "parameters": of_parameters(parameters, fits, settings),
    }


def of_figures(figures: xr.Dataset, command: str) -> Report:
    """Return the article's figures by rows of its tables, bins separated by slashes."""
    rows: list[dict[str, Any]] = []
    names = [str(name).rpartition(", ")[0] for name in figures.figure.values]
    for name in dict.fromkeys(names):
        here = figures.isel(figure=[k for k, one in enumerate(names) if one == name])
        row = {
            "what": CATEGORIES.get(name, name),
            "article": slashed(here.article.values),
            "range": slashed(zip(here.least.values, here.largest.values, strict=True)),
            "agreeing": slashed(100 * here.agreeing.values),
            "nearest": slashed(here.nearest.values, ".1f"),
        }
        for fit in SHOWN:
            of = here.sel(fitted=fit)
            ends = zip(of.percent_low.values, of.percent_high.values, strict=True)
            row[fit] = f"{slashed(of.percent.values)} ({slashed(ends)})"
        rows.append(row)
    return Report(
        "The article's figures beside those of settings",
        (
            Column("what", "figure"),
            Column("article", "article"),
            Column("range", "all settings"),
            Column("agreeing", "settings that agree [%]"),
            Column("nearest", "nearest [σ]"),
            *(Column(fit, f"fitted to {fit}") for fit in SHOWN),
        ),
        rows,
        [
            f"{command} Percent correct, by bin. All settings: least–largest mean of their draws. "
            f"A setting agrees within {AGREES:g} standard deviations, binomial ones of as many "
            "views as the article's and those of our mean. Fitted: mean of the posterior, and its "
            "middle 95 %."
        ],
    )


def of_fits(fits: xr.Dataset, figures: int, command: str) -> Report:
    """Return the distances to each table, by the tables that settings are fitted to."""
    rows = [
        {
            "fitted": "none (prior)" if fit == "none" else fit,
            **{
                f"table_{table}": f"{float(one.distance.sel(table=table)):.1f}"
                f" ({float(one.best.sel(table=table)):.1f})"
                + ("" if table in FITS[fit] else " *" if fit != "none" else "")
                for table in one.table.values.tolist()
            },
            "temperature": f"{float(one.temperature):.1f}",
            "effective": f"{float(one.effective):.0f}",
        }
        for fit in FITS
        for one in [fits.sel(fitted=fit)]
    ]
    least = ", ".join(f"{value:.1f}" for value in fits.least.values)
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
            f"tables that it is not fitted to. The least of all settings: {least}. One setting "
            f"agrees with at most {int(fits.together)} of {figures} figures."
        ],
    )


def of_parameters(parameters: xr.Dataset, fits: xr.Dataset, settings: xr.Dataset) -> Report:
    """Return the parameters that posteriors say most of."""
    information = parameters.information.sel(fitted=list(SHOWN))
    most = information.max("fitted")
    names = most.sortby(most, ascending=False).parameter.values[:LISTED]
    rows: list[dict[str, Any]] = []
    for name in map(str, names):
        prior, here = PRIORS[name], parameters.sel(parameter=name)
        row = {"what": f"{prior.group}: {prior.label}"}
        if isinstance(prior, Choice):
            row["prior"] = ", ".join(map(str, prior.values)).replace("_", " ")
        else:
            row["prior"] = f"{number(prior.low)}–{number(prior.high)}"
        for fit in SHOWN:
            one = here.sel(fitted=fit)
            median, low, high = (float(one[key]) for key in ("median", "median_low", "median_high"))
            if isinstance(prior, Choice):
                places = settings.value.sel(parameter=name, setting=fits.setting).values
                share = np.bincount(places.astype(int), fits.weight.sel(fitted=fit).values)
                word = str(prior.values[int(share.argmax())]).replace("_", " ")
                shown = f"{word} {100 * share.max():.0f} %"
            else:
                shown = f"{number(median)} ({number(low)}–{number(high)})"
            row[fit] = f"{shown}; {float(one.information):.2f} bit"
        rows.append(row)
    return Report(
        "Parameters that the article's tables say most of",
        (
            Column("what", "parameter"),
            Column("prior", "prior"),
            *(Column(fit, f"fitted to {fit}") for fit in SHOWN),
        ),
        rows,
        [
            "Median of the posterior and its middle 95 %, or its most probable word; information "
            "on the prior. All parameters are in the picture."
        ],
    )


def slashed(values: Iterable[Any], spec: str = ".0f") -> str:
    """Return numbers, or pairs of them, separated by slashes."""
    return " / ".join(
        "–".join(f"{end:{spec}}" for end in np.atleast_1d(np.asarray(value, dtype=float)))
        for value in values
    )


def number(value: float) -> str:
    """Return a number with three digits, at least to the unit."""
    return f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"
