"""Tables of the benchmark of classifiers on splits, and its ranking by held-out seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import stats

from benchmarks.reports import Column, Report
from docs._tables.repeated import Interval
from docs._tables.sweeping import sweep_groups
from ncti.data.splits import OUTSIDERS, SPLITS
from studies.benchmark.stages import ENTRIES, REFERENCE, SENSOR, TESTS
from studies.benchmark.summary import tabulate_differences, tabulate_rows
from sweeps.report.words import WORDS, value_text

RANKING_SEEDS = 3  # seeds, for the ranking
TITLES = {name: WORDS.get(name, value_text(name)) for name in ENTRIES}
TITLES["likelihood"] = "likelihood"  # as on other pages
NAMING_SPLITS = tuple(name for name in SPLITS if name not in OUTSIDERS)  # for the ship's name
README_SPLITS = ("aspect-random", "aspect-gap", "range-shift", "variant")  # in README
LEVEL = 0.01  # of tests of differences
BEST_METHODS = ("likelihood", "random_forest", "gradient_boosting")

Floats = NDArray[np.float64]
Reports = dict[str, Report]


def measure(more: Sequence[str] = (), held_out: int = RANKING_SEEDS) -> Reports:
    """Return the tables by name, after the sweep of all splits and classifiers.

    Parameters
    ----------
    more : sequence of str
        Further arguments of `ncti-sweep`.
    held_out : int
        Number of seeds by which the ranking of the others is checked.
    """
    groups = [TESTS.path, *(f"{SENSOR}/{name}" for name in ENTRIES)]
    entered = f"benchmark.classifier=[{','.join(ENTRIES)}]"  # those of extras, too
    overrides = [f"+experiment={SENSOR}", entered, *more]
    return tables_of(sweep_groups(overrides, groups, label="the benchmark"), held_out)


def tables_of(groups: Mapping[str, xr.Dataset], held_out: int) -> Reports:
    """Return the tables of a store's groups: means over all seeds, and the ranking.

    Parameters
    ----------
    groups : mapping of str to xarray.Dataset
        Tests and answers, by the names of their groups.
    held_out : int
        Number of seeds, the last ones, that are held out to check the ranking of the others.
    """
    tests = groups[TESTS.path]
    seeds = tests.sizes["seed"]
    tables = {
        name: tabulate_rows(groups[f"{SENSOR}/{name}"], tests)
        for name in TITLES
        if f"{SENSOR}/{name}" in groups
    }
    splits = [str(split) for split in tests.split.values]
    title = f"percent correct, mean of {seeds} seeds [95 % interval]"
    known_splits = [name for name in NAMING_SPLITS if name in splits]
    short = {name: table for name, table in tables.items() if name in BEST_METHODS}
    published = [split for split in known_splits if split in README_SPLITS]
    return {
        "summary": _table(short, published, "accuracy", title, "Ships named correctly, in short"),
        "splits": _table(tables, known_splits, "accuracy", title, "Ships named correctly"),
        "unknown": _rejection_table(
            tables, [split for split in splits if split in OUTSIDERS], seeds
        ),
        "probabilities": _probabilities(tables, seeds),
        "differences": _differences(groups, known_splits, seeds),
        "ranking": _ranking(groups, known_splits, seeds - held_out),
    }


def correct_of(answers: xr.Dataset, tests: xr.Dataset) -> Floats:
    """Return (split, seed) percent correct of known ships."""
    known = tests.true_ship >= 0
    right = ((answers.predicted == tests.true_ship) & known).sum("row")
    percent: Floats = (100.0 * right / known.sum("row")).transpose("split", "seed").values
    return percent


def kendall(first: Floats, second: Floats) -> tuple[float, list[tuple[int, int]]]:
    """Return Kendall's tau of two scores of the same items, and the pairs that swap."""
    tau = float(stats.kendalltau(first, second).statistic)
    pairs = combinations(range(len(first)), 2)
    return tau, [(i, k) for i, k in pairs if (first[i] - first[k]) * (second[i] - second[k]) < 0]


def _figure_text(
    table: xr.Dataset, figure: str, split: str, *, digits: int = 0, factor: float = 1
) -> str:
    """Return a figure of a split with its interval, empty without any."""
    values = table.sel(split=split)
    ends = (factor * float(values[figure + end]) for end in ("", "_low", "_high"))
    text = Interval(*ends).text(digits)
    return "" if "nan" in text else text


def _table(
    tables: Mapping[str, xr.Dataset], splits: Sequence[str], figure: str, head: str, title: str
) -> Report:
    """Return percentages by classifier and split."""
    rows = [
        {"what": TITLES[name]}
        | {split: _figure_text(table, figure, split, factor=100) for split in splits}
        for name, table in tables.items()
    ]
    return Report(title, (Column("what", head), *(Column(split, split) for split in splits)), rows)


def _rejection_table(tables: Mapping[str, xr.Dataset], splits: Sequence[str], seeds: int) -> Report:
    """Return the share kept by rejection, and the areas, by classifier and unknown ship."""
    figures = {"kept": ("% kept", 0, 100), "auroc": ("AUROC", 2, 1), "oscr": ("OSCR", 2, 1)}
    columns = [Column("what", f"mean of {seeds} seeds [95 % interval]")]
    columns += [
        Column(f"{split} {name}", f"{split}: {figures[name][0]}")
        for split in splits
        for name in figures
    ]
    rows = []
    for name, table in tables.items():
        row = {"what": TITLES[name]}
        for split in splits:
            for figure, (_, digits, factor) in figures.items():
                text = _figure_text(table, figure, split, digits=digits, factor=factor)
                row[f"{split} {figure}"] = text
        rows.append(row)
    return Report("Rejection of unknown ships", tuple(columns), rows)


def _probabilities(tables: Mapping[str, xr.Dataset], seeds: int) -> Report:
    """Return log losses and calibration errors of classifiers that state probabilities."""
    splits = ("aspect-random", "sensor-shift", "few-frames")
    present = [split for split in splits if split in next(iter(tables.values())).split.values]
    figures = {"log_loss": "log loss", "ece": "ECE"}
    columns = [Column("what", f"mean of {seeds} seeds [95 % interval]")]
    columns += [
        Column(f"{split} {name}", f"{split}: {figures[name]}")
        for split in present
        for name in figures
    ]
    rows = [
        {"what": TITLES[name]}
        | {
            f"{split} {key}": _figure_text(table, key, split, digits=2)
            for split in present
            for key in figures
        }
        for name, table in tables.items()
        if np.isfinite(table.log_loss.values).any()
    ]
    return Report("Stated probabilities", tuple(columns), rows)


def _differences(groups: Mapping[str, xr.Dataset], splits: Sequence[str], seeds: int) -> Report:
    """Return the advantage of each classifier over the reference, and its significance."""
    tests, reference = groups[TESTS.path], groups[f"{SENSOR}/{REFERENCE}"]
    rows = []
    for name in TITLES:
        if name == REFERENCE or f"{SENSOR}/{name}" not in groups:
            continue
        table = tabulate_differences(groups[f"{SENSOR}/{name}"], reference, tests)
        row = {"what": TITLES[name]}
        for split in splits:
            figures = table.sel(split=split)
            ends = ("difference", "difference_low", "difference_high")
            text = Interval(*(100 * float(figures[end]) for end in ends)).text(sign="+")
            row[split] = text + ("" if float(figures.p_value) < LEVEL else " (n.s.)")
        rows.append(row)
    head = f"percent more than {TITLES[REFERENCE]}, mean of {seeds} seeds [95 % interval]"
    columns = (Column("what", head), *(Column(split, split) for split in splits))
    note = f"n.s.: not significant at the level of {LEVEL:g} by McNemar's test of views."
    return Report("Differences", columns, rows, [note])


def _ranking(groups: Mapping[str, xr.Dataset], splits: Sequence[str], seeds: int) -> Report:
    """Compare the ranking of classifiers by held-out seeds with the published one, by split."""
    tests = groups[TESTS.path].sel(split=list(splits))
    names = [name for name in TITLES if f"{SENSOR}/{name}" in groups]
    percent = np.stack(
        [correct_of(groups[f"{SENSOR}/{n}"].sel(split=list(splits)), tests) for n in names]
    )
    rows = []
    for k, split in enumerate([*splits, "mean of splits"]):
        of_split = percent[:, k] if k < len(splits) else percent.mean(axis=1)
        published, held_out = of_split[:, :seeds].mean(axis=1), of_split[:, seeds:].mean(axis=1)
        tau, swaps = kendall(published, held_out)
        order = ", ".join(TITLES[names[i]] for i in np.argsort(-published))
        pairs = ", ".join(f"{TITLES[names[i]]} and {TITLES[names[j]]}" for i, j in swaps)
        rows.append({"split": split, "order": order, "tau": f"{tau:.2f}", "swaps": pairs or "none"})
    number = percent.shape[-1] - seeds
    columns = (
        Column("split", "split"),
        Column("order", f"best first, {seeds} seeds"),
        Column("tau", f"Kendall's tau with {number} held-out seeds"),
        Column("swaps", "pairs that swap"),
    )
    return Report("Ranking", columns, rows)
