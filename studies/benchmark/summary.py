"""Tables of the answers of a classifier to the rows of splits: means over seeds with intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.evaluate import Scores, compare, grouped_accuracy, score
from ncti.evaluate.replicates import CONFIDENCE
from ncti.evaluate.scores import BIN_WIDTH
from ncti.labels import labelled_dataset

if TYPE_CHECKING:  # xarray takes a third of a second: it is imported where it is used
    import xarray as xr

Floats = NDArray[np.float64]

SPLIT, SEED = "split", "seed"
NO_ROW = -2  # of a ship, where a split has fewer rows than others
MIN_VIEWS = 10  # views, right or wrong, below which the scatter of seeds says too little
SIDE = np.arange(0.0, 180.0, BIN_WIDTH)  # lowest aspects of bins [deg]
FIGURES = {
    "log_loss": "mean negative logarithm of the probability of the true ship",
    "ece": "expected calibration error, mean distance of confidence and share of right answers",
    "auroc": "probability that an answer to a known ship is more similar than one to an unknown",
    "oscr": "probability that it is right, too",
    "kept": "fraction of answers to known ships that are right and accepted where 90 % of those to "
    "unknown ones are rejected",
}
UNITS = {"log_loss": "nat"}


def tabulate_rows(answers: xr.Dataset, tests: xr.Dataset) -> xr.Dataset:
    """Return all scores of answers to the tests of splits, as means over seeds with intervals.

    `answers` has, over split, seed and row, `predicted`, the ship named, as an index; `probability`
    over ship as well, NaN if the classifier has none; and `similarity`. `tests` has `true_ship`, an
    index into the coordinate `ship` of the answers, -1 of a ship that was not learned and -2 where
    there is no row; `true_aspect` [deg]; and `view`.

    The table has by split: `accuracy` and the figures of `score`, each with `_low` and `_high`, the
    ends of its 95 % interval, and `accuracy_n` answers; `aspect_accuracy` by `aspect_bin`;
    `confusion` by ship and ship named, the shares of answers; `reliability` by `confidence` with
    `reliability_n` answers.

    Intervals are Student's t of seeds, which draw training and tests anew. With one seed, or where
    fewer than ten views are right or wrong, those of accuracies are widened to include the interval
    of all views (`grouped_accuracy`).
    """
    import xarray as xr

    splits = [str(name) for name in answers[SPLIT].values]
    by_split = []
    for name in splits:
        seeds = [_scores(answers, tests, name, seed) for seed in answers[SEED].values]
        by_split.append(_average_seeds(seeds))
    table = xr.concat([labelled_dataset(figures) for figures in by_split], SPLIT)
    low = SIDE.tolist()
    return table.assign_coords(
        {
            SPLIT: answers[SPLIT],
            "aspect_bin": [f"{low_:g}-{low_ + BIN_WIDTH:g}" for low_ in low],
            "ship": answers.ship,
            "ship_named": np.asarray(answers.ship.values),
        }
    )


def tabulate_differences(answers: xr.Dataset, others: xr.Dataset, tests: xr.Dataset) -> xr.Dataset:
    """Return the difference in accuracy between two classifiers by split, of the same rows.

    Arguments are as of `tabulate_rows`. The table has `difference` of the fractions of right
    answers, the mean over seeds, with `difference_low` and `difference_high`, Student's t interval
    of 95 % of seeds, or the bootstrap of views where there is one seed; and `p_value`, McNemar's
    test of the views of all seeds. The interval reflects the scatter of trainings and tests,
    McNemar's test only that of tests.
    """
    import xarray as xr

    rows = []
    for name in answers[SPLIT].values:
        truth = tests.sel({SPLIT: name})
        known = truth.true_ship.values >= 0
        right = [
            dataset.sel({SPLIT: name}).predicted.values == truth.true_ship.values
            for dataset in (others, answers)
        ]
        seeds = np.indices(known.shape)[0]
        views = _views(truth.view.values, seeds)[known]
        first, second = (correct[known] for correct in right)
        outcome = compare(first, second, views, rng=np.random.default_rng(0))
        means = [(correct & known).sum(axis=1) / known.sum(axis=1) for correct in right]
        mean, low, high = interval(means[1] - means[0], -1.0, 1.0)
        if len(known) == 1:
            low, high = outcome.ci_low, outcome.ci_high
        rows.append(
            {
                "difference": (mean, "fraction of right answers less that of the other"),
                "difference_low": (low, "lower end of its 95 % interval"),
                "difference_high": (high, "upper end of its 95 % interval"),
                "p_value": (outcome.p_value, "probability of it if both were equally good"),
            }
        )
    table = xr.concat([labelled_dataset(row) for row in rows], SPLIT)
    return table.assign_coords({SPLIT: answers[SPLIT]})


def interval(values: Floats, minimum: float, maximum: float) -> tuple[float, float, float]:
    """Return the mean of independent values, and the ends of its 95 % interval by Student's t.

    `values` (seed,) count unless NaN; the interval ends within `minimum` and `maximum`, and is NaN
    for fewer than two values.
    """
    from scipy.special import stdtrit

    finite = values[np.isfinite(values)]
    mean = float(finite.mean()) if finite.size else np.nan
    if finite.size < 2:
        return mean, np.nan, np.nan
    error = float(finite.std(ddof=1)) / np.sqrt(finite.size)
    reach = float(stdtrit(finite.size - 1, 0.5 + 0.5 * CONFIDENCE)) * error
    return mean, max(mean - reach, minimum), min(mean + reach, maximum)


def _views(view: NDArray[Any], seeds: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return numbers of views that are distinct between seeds."""
    numbers: NDArray[np.int64] = seeds * (int(view.max(initial=0)) + 1) + view
    return numbers


def _scores(
    answers: xr.Dataset, tests: xr.Dataset, name: str, seed: Any
) -> tuple[Scores, NDArray[Any], Floats, NDArray[np.bool_]]:
    """Return the scores of one seed, and the views, aspects and right answers of known ships."""
    answered, truth = (dataset.sel({SPLIT: name, SEED: seed}) for dataset in (answers, tests))
    exists = truth.true_ship.values > NO_ROW
    ship, view, aspect = (truth[key].values[exists] for key in ("true_ship", "view", "true_aspect"))
    likely = answered.probability.transpose("row", "ship").values[exists].astype(np.float64)
    likely /= likely.sum(axis=1, keepdims=True)
    predicted = answered.predicted.values[exists]
    centres = SIDE[np.searchsorted(SIDE, aspect, side="right") - 1] + BIN_WIDTH / 2
    scores = score(
        ship,
        likely if np.isfinite(likely).all() else predicted,
        aspect=centres,
        groups=view,
        classes=np.arange(answers.sizes["ship"]),
        similarity=answered.similarity.values[exists],
    )
    known = ship >= 0
    return scores, view[known], centres[known], (predicted == ship)[known]


def _average_seeds(
    seeds: list[tuple[Scores, NDArray[Any], Floats, NDArray[np.bool_]]],
) -> dict[str, tuple[Any, ...]]:
    """Return the figures of one split, as means over its seeds, each with its label."""
    import xarray as xr

    numbers = np.concatenate([np.full(len(view), k) for k, (_, view, *_) in enumerate(seeds)])
    view, centres, right = (np.concatenate([scored[k] for scored in seeds]) for k in (1, 2, 3))
    pooled = grouped_accuracy(right, centres, _views(view, numbers))
    fractions = np.array([scores.accuracy.fraction[-1] for scores, *_ in seeds])
    mean, low, high = interval(fractions, 0.0, 1.0)
    views = len(np.unique(_views(view, numbers)))
    if len(seeds) == 1 or min(mean, 1 - mean) * views < MIN_VIEWS:
        low = float(np.fmin(low, pooled.ci_low[-1]))
        high = float(np.fmax(high, pooled.ci_high[-1]))
    share = "fraction of ships named correctly"
    ends = ("lower end of its 95 % interval", "upper end of its 95 % interval")
    figures: dict[str, tuple[Any, ...]] = {
        "accuracy": (mean, share),
        "accuracy_low": (low, ends[0]),
        "accuracy_high": (high, ends[1]),
        "accuracy_n": (float(len(right)), "answers"),
    }
    for name, label in FIGURES.items():
        most = np.inf if name == "log_loss" else 1.0
        estimate = interval(np.array([getattr(scores, name) for scores, *_ in seeds]), 0.0, most)
        for suffix, value, text in zip(
            ("", "_low", "_high"), estimate, (label, *ends), strict=True
        ):
            figures[name + suffix] = (value, text)
    for name, unit in UNITS.items():
        figures |= {key: (*figures[key], unit) for key in (name, f"{name}_low", f"{name}_high")}
    # By aspect: the views of all seeds.
    bin_index = np.searchsorted(SIDE, [float(label) for label in pooled.labels[:-1]]) - 1
    for name, values, text in (
        ("aspect_accuracy", pooled.fraction, f"{share}, by aspect"),
        ("aspect_accuracy_low", pooled.ci_low, ends[0]),
        ("aspect_accuracy_high", pooled.ci_high, ends[1]),
    ):
        by_aspect = np.full(len(SIDE), np.nan)
        by_aspect[bin_index] = values[:-1]
        figures[name] = xr.DataArray(by_aspect, dims="aspect_bin"), text
    confusion = np.sum([scores.confusion for scores, *_ in seeds], axis=0)
    shares = confusion / np.maximum(confusion.sum(axis=1, keepdims=True), 1)
    label = "share of answers to a ship that name another"
    figures["confusion"] = xr.DataArray(shares, dims=("ship", "ship_named")), label
    curves = [scores.reliability for scores, *_ in seeds if scores.reliability is not None]
    n = np.sum([curve.n for curve in curves], axis=0) if curves else np.zeros(10)
    hits = np.nansum([curve.fraction * curve.n for curve in curves], axis=0) if curves else n
    fraction = np.where(n > 0, hits / np.maximum(n, 1), np.nan)
    label = "share of right answers, by tenth of the probability of the ship named"
    figures["reliability"] = xr.DataArray(fraction, dims="confidence"), label
    figures["reliability_n"] = xr.DataArray(n.astype(float), dims="confidence"), "answers"
    return figures
