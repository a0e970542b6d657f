"""Unknown ships: which answers a test vigilance takes back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.evaluate import replicated_accuracy, wilson_interval
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Condition, Table
from sweeps.stages.classifier import Classifier, learned_of

if TYPE_CHECKING:
    import xarray as xr

ASPECTS = ("learned", "between")  # aspects that are learned, and those that are not
VIEW = ("ship", "aspect")
ENDS = {"_ci_low": "lower", "_ci_high": "upper"}
LEAST = (0.0, 0.5, 0.8, 0.9, 0.95)  # of the answers to unknown ships that are to be rejected
MEANINGS = {
    "rejected_unknown": "fraction of answers to unknown ships that are rejected",
    "rejected_known": "fraction of answers to known ships that are rejected",
    "correct_known": "fraction of answers to known ships that are right and not rejected",
    "n_unknown": "answers to unknown ships",
    "n_known": "answers to known ships",
    "correct_where_rejected": "fraction of answers to known ships that are right and not rejected "
    "where at least so many of those to unknown ones are",
    "rejected_up_to": "largest cosine that must be rejected for that, none where all are accepted",
    "area": "area under right over let through, as fractions of all answers",
}


def rejection_table(name: str, answers: str, when: Condition) -> Table:
    """Return the declaration of a table of rejections, made where a view is not learned.

    Parameters
    ----------
    name : str
        Name of the classifier.
    answers : str
        Group of its answers, a `similarity` among them.
    when : callable
        Whether a configuration has these.
    """

    def make(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
        vigilances = choices[Classifier.test_vigilance]
        return tabulate_rejection(classified, learned_of(choices), vigilances)

    def asked(choices: Choices) -> bool:
        return when(choices) and not learned_of(choices).all()

    return Table(f"tables/rejection_{name}", (answers,), make, asked)


def tabulate_rejection(
    classified: xr.Dataset, learned: NDArray[np.bool_], test_vigilances: tuple[float, ...]
) -> xr.Dataset:
    """Tabulate the receiver operating characteristic: what every test vigilance rejects.

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

        Of the whole characteristic, whatever the test vigilances: `correct_where_rejected` and
        `rejected_up_to` over `least_rejected`, and `area`.

    Notes
    -----
    The characteristic has a corner at every similarity of an answer to an unknown ship. To reject
    a share of these answers all up to a quantile must go, and whatever else is no more similar.
    The area under it, of known ships right over unknown ships let through, is the probability
    that an answer to a known ship is right and more similar than one to an unknown ship, a tie
    counting half (J. A. Hanley and B. J. McNeil 1982, Radiology 143, 29).

    Intervals are those of the other tables: over replicates of the noise as
    `ncti.evaluate.replicated_accuracy` has them, over phases and orders of the views that one of
    them sees.
    """
    # Imported where it is used: xarray takes a third of a second.
    import xarray as xr

    known = xr.DataArray(learned.any(axis=1), dims="ship")
    taught = xr.DataArray(learned.any(axis=0), dims="aspect")
    thresholds = xr.DataArray(
        np.array(test_vigilances),
        dims="test_vigilance",
        coords={"test_vigilance": np.array(test_vigilances)},
    )
    similarity, right = classified.similarity, classified.correct == 1
    accepted = similarity >= thresholds
    draws = [name for name in ("replicate", "phase", "order") if name in classified.correct.dims]
    parts = []
    for name, aspects in zip(ASPECTS, (taught, ~taught), strict=True):
        of_known = (classified.correct >= 0) & known & aspects
        of_unknown = similarity.notnull() & ~known & aspects  # whatever would be right
        up_to = _up_to(similarity, of_unknown, [*draws, *VIEW])
        counted = {
            "rejected_unknown": (~accepted, of_unknown),
            "rejected_known": (~accepted, of_known),
            "correct_known": (accepted & right, of_known),
            "correct_where_rejected": ((similarity > up_to) & right, of_known & up_to.notnull()),
        }
        found = {"n_unknown": of_unknown, "n_known": of_known}
        part = {figure: answers.sum([*draws, *VIEW]) for figure, answers in found.items()}
        part["rejected_up_to"] = up_to.where(up_to > -np.inf)
        part["area"] = _area(similarity, right & of_known, of_known, of_unknown, [*draws, *VIEW])
        for figure, (hits, answers) in counted.items():
            for suffix, values in zip(("", *ENDS), _share(hits, answers, draws), strict=True):
                part[figure + suffix] = values
        parts.append(xr.Dataset(part).expand_dims(aspects=np.array([name], dtype=object)))
    table = xr.concat(parts, "aspects")
    for name, meaning in MEANINGS.items():
        table[name].attrs = {"units": "1", "long_name": meaning}
        for suffix, end in ENDS.items() if name + "_ci_low" in table else ():
            table[name + suffix].attrs = {
                "units": "1",
                "long_name": f"{end} end of the 95 % Wilson interval of the {meaning}",
            }
    table.test_vigilance.attrs = {"units": "1", "long_name": "cosine that an answer must reach"}
    table.least_rejected.attrs = {
        "units": "1",
        "long_name": "fraction of answers to unknown ships that is rejected at least",
    }
    table.aspects.attrs = {"long_name": "whether anything was learned at the aspect"}
    return table


def _up_to(similarity: xr.DataArray, of_unknown: xr.DataArray, pooled: list[str]) -> xr.DataArray:
    """Return, over least_rejected, up to where answers go; -inf where none do, NaN without any."""
    import xarray as xr

    def quantiles(values: NDArray[np.floating], unknown: NDArray[np.bool_]) -> NDArray[np.floating]:
        ranked = np.sort(values[unknown])
        if not ranked.size:
            return np.where(np.array(LEAST) > 0, np.nan, -np.inf)
        count = np.ceil(np.array(LEAST) * ranked.size - 1e-9).astype(int)
        return np.where(count > 0, ranked[np.maximum(count - 1, 0)], -np.inf)

    found: xr.DataArray = xr.apply_ufunc(
        quantiles,
        similarity,
        of_unknown,
        input_core_dims=[pooled, pooled],
        output_core_dims=[["least_rejected"]],
        vectorize=True,
    )
    return found.assign_coords(least_rejected=np.array(LEAST))


def _area(
    similarity: xr.DataArray,
    hits: xr.DataArray,
    of_known: xr.DataArray,
    of_unknown: xr.DataArray,
    pooled: list[str],
) -> xr.DataArray:
    """Return the area under the characteristic, by counting pairs; NaN without any."""
    import xarray as xr

    def area(values: NDArray[np.floating], *which: NDArray[np.bool_]) -> float:
        right, known, unknown = which
        ranked = np.sort(values[unknown])
        pairs = known.sum() * ranked.size
        below = np.searchsorted(ranked, values[right], "left")
        upto = np.searchsorted(ranked, values[right], "right")
        return float((below + upto).sum() / 2 / pairs) if pairs else np.nan

    found: xr.DataArray = xr.apply_ufunc(
        area,
        similarity,
        hits,
        of_known,
        of_unknown,
        input_core_dims=[pooled] * 4,
        vectorize=True,
    )
    return found


def _share(
    hits: xr.DataArray, answers: xr.DataArray, draws: list[str]
) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """Return the fraction of answers that hit, and both ends of its interval."""
    import xarray as xr

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
