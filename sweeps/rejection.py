"""Unknown ships: which answers a test vigilance takes back."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ncti.evaluate import replicated_accuracy, wilson_interval

ASPECTS = ("learned", "between")  # aspects that are learned, and those that are not
VIEW = ("ship", "aspect")
ENDS = {"_ci_low": "lower", "_ci_high": "upper"}
MEANINGS = {
    "rejected_unknown": "fraction of answers to unknown ships that are rejected",
    "rejected_known": "fraction of answers to known ships that are rejected",
    "correct_known": "fraction of answers to known ships that are right and not rejected",
    "n_unknown": "answers to unknown ships",
    "n_known": "answers to known ships",
}


def tabulate_rejection(
    classified: xr.Dataset, learned: NDArray[np.bool_], test_vigilances: tuple[float, ...]
) -> xr.Dataset:
    """Fractions rejected and right at every test vigilance: the receiver operating characteristic.

    Parameters
    ----------
    classified : xarray.Dataset
        The store's group of a classifier that tells a similarity.
    learned : (ship, aspect) bool ndarray
        Views that it has learned. A ship without any is unknown.
    test_vigilances : tuple of float
        Cosines below which a test answers "unknown".

    Returns
    -------
    xarray.Dataset
        Over the classifier's axes, `test_vigilance` and `aspects` (learned, or between them):
        `rejected_unknown`, of the answers to unknown ships; `rejected_known` and
        `correct_known`, of those to the others, the latter neither rejected nor wrong; `n_unknown`
        and `n_known`, answers. NaN without answers. Means over replicates, phases and orders, with
        `..._ci_low` and `..._ci_high`.

    Notes
    -----
    Intervals are those of the other tables: over replicates of the noise as
    `ncti.evaluate.replicated_accuracy` has them, over phases and orders of the views that one of
    them sees.
    """
    known = xr.DataArray(learned.any(axis=1), dims="ship")
    taught = xr.DataArray(learned.any(axis=0), dims="aspect")
    thresholds = xr.DataArray(
        np.array(test_vigilances),
        dims="test_vigilance",
        coords={"test_vigilance": np.array(test_vigilances)},
    )
    there = classified.correct >= 0
    accepted = classified.similarity >= thresholds
    right = accepted & (classified.correct == 1)
    draws = [name for name in ("replicate", "phase", "order") if name in classified.correct.dims]
    parts = []
    for name, aspects in zip(ASPECTS, (taught, ~taught), strict=True):
        of_known, of_unknown = there & known & aspects, there & ~known & aspects
        counted = {
            "rejected_unknown": (~accepted, of_unknown),
            "rejected_known": (~accepted, of_known),
            "correct_known": (right, of_known),
        }
        found = {"n_unknown": of_unknown, "n_known": of_known}
        part = {figure: answers.sum([*draws, *VIEW]) for figure, answers in found.items()}
        for figure, (hits, answers) in counted.items():
            for suffix, values in zip(("", *ENDS), _share(hits, answers, draws), strict=True):
                part[figure + suffix] = values
        parts.append(xr.Dataset(part).expand_dims(aspects=np.array([name], dtype=object)))
    table = xr.concat(parts, "aspects")
    for name, meaning in MEANINGS.items():
        table[name].attrs = {"units": "1", "long_name": meaning}
        for suffix, end in ENDS.items() if not name.startswith("n_") else ():
            table[name + suffix].attrs = {
                "units": "1",
                "long_name": f"{end} end of the 95 % Wilson interval of the {meaning}",
            }
    table.test_vigilance.attrs = {"units": "1", "long_name": "cosine that an answer must reach"}
    table.aspects.attrs = {"long_name": "whether anything was learned at the aspect"}
    return table


def _share(
    hits: xr.DataArray, answers: xr.DataArray, draws: list[str]
) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """Fraction of answers that hit, and both ends of its interval."""
    hits, answers = xr.broadcast(hits & answers, answers)
    n = answers.sum([*draws, *VIEW])
    fraction = hits.sum([*draws, *VIEW]) / n.where(n > 0)
    if draws == ["replicate"]:
        order = [name for name in fraction.dims] + [*draws, *VIEW]
        score = replicated_accuracy(
            hits.transpose(*order).values,
            np.zeros(hits.sizes["aspect"]),  # all of them together
            answered=answers.transpose(*order).values,
        )
        low, high = score.ci_low[..., -1], score.ci_high[..., -1]
    else:
        # More looks at a view are no more views; one that failed has none.
        views = answers.sum(VIEW).max(draws)
        low, high = wilson_interval((fraction.fillna(0) * views).clip(0, views), views)
    return fraction, fraction.copy(data=low), fraction.copy(data=high)
