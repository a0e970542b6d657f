"""Tables of answers: percent correct by aspect bin, and unknown ships by test vigilance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ncti.evaluate import (
    accuracy_by_aspect,
    aspect_bins,
    open_set_scores,
    replicated_accuracy,
)

if TYPE_CHECKING:  # xarray takes a third of a second: it is imported where it is used
    import xarray as xr

Flags = NDArray[np.bool_]
Floats = NDArray[np.floating]
Scored: TypeAlias = "dict[str, tuple[xr.DataArray, str]]"
VIEW = ("ship", "aspect")
OF_ASPECTS = {"long_name": "whether aspects are learned, lie between, or are drawn at random"}
# Draws of noise, positions and orders, over which accuracies are means.
DRAWS = ("replicate", "ifov_phase", "phase", "order", "draw")
PROFILES = {
    "training_correct": ("training_", "training profiles"),
    "ship_correct": ("ship_", "ships of test profiles"),
    "correct": ("", "test profiles"),
}
"""Variables of answers about range profiles, with the prefix and words of their scores."""


def formed(classified: xr.Dataset, what: str) -> Scored:
    """Return the numbers of categories and of views of every training."""
    category = classified.training_category
    return {
        "category_count": ((category.max(VIEW) + 1).astype("i4"), "categories formed"),
        "view_count": ((category >= 0).sum(VIEW).astype("i4"), what),
        "settled": ((classified.passes > 0).astype("i1"), "1 where the categories settled"),
    }


def scored(correct: xr.DataArray, prefix: str, what: str) -> Scored:
    """Return `accuracy`, `ci_low`, `ci_high` and `n` by aspect bin, prefixed, with long names.

    Of (..., ship, aspect) answers: 1 where right, 0 where not, negative where nothing was asked.
    Means over draws have intervals that take in views and draws (`replicated_accuracy`), and a
    `spread`.
    """
    import xarray as xr

    draws = tuple(name for name in DRAWS if name in correct.dims)
    answers = correct.transpose(..., *draws, *VIEW)
    right, asked, aspect = answers.values == 1, answers.values >= 0, answers.aspect.values
    score = replicated_accuracy(right, aspect, draws=len(draws), answered=asked)
    gone = (*draws, *VIEW)
    coords: dict[Any, Any] = {
        name: coord for name, coord in answers.coords.items() if not {name, *coord.dims} & {*gone}
    }
    coords["aspect_bin"] = np.array(score.labels)
    dims = (*answers.dims[: -len(gone)], "aspect_bin")
    more: list[tuple[str, Floats, str]] = []
    if draws:
        alone = xr.DataArray(
            accuracy_by_aspect(right, aspect, answered=asked).fraction,
            dims=(*answers.dims[:-2], "aspect_bin"),
        )
        said = f"standard deviation of that fraction over {' and '.join(draws)}"
        more = [("spread", alone.std(draws).values, said)]
    return {
        prefix + suffix: (xr.DataArray(values, coords, dims), long_name)
        for suffix, values, long_name in (
            ("accuracy", score.fraction, f"fraction of {what} classified correctly"),
            ("ci_low", score.ci_low, "lower end of its 95 % Wilson interval"),
            ("ci_high", score.ci_high, "upper end of its 95 % Wilson interval"),
            ("n", score.n, f"number of {what}"),
            *more,
        )
    }


def by_aspects(
    correct: xr.DataArray,
    aspects: Mapping[str, xr.DataArray],
    score: Callable[[xr.DataArray], Scored],
) -> Scored:
    """Return scores of answers at aspects of several kinds apart, along `aspects`.

    Of one kind there is no such dimension.
    """
    import xarray as xr

    if len(aspects) < 2:
        return score(correct)
    parts = [score(correct.where(where, -1)) for where in aspects.values()]
    names = xr.DataArray(list(aspects), dims="aspects", attrs=OF_ASPECTS, name="aspects")
    return {
        name: (xr.concat([part[name][0] for part in parts], names), what)
        for name, (_, what) in parts[0].items()
    }


def scored_profiles(classified: xr.Dataset, aspects: Mapping[str, xr.DataArray]) -> Scored:
    """Return the scores of all answers about range profiles that a classifier gives.

    Tests at aspects of several kinds are scored apart.
    """
    tables: Scored = {}
    for name, (prefix, what) in PROFILES.items():
        if name in classified:
            score = partial(scored, prefix=prefix, what=what)
            of_kinds = {} if prefix == "training_" else aspects
            tables |= by_aspects(classified[name], of_kinds, score)
    return tables


def data_set(tables: Scored, aspect: xr.DataArray | None) -> xr.Dataset:
    """Return tables without units as a data set, each with its long name.

    Of aspects [deg] that were pooled the lowest of every bin is a coordinate; None where tables
    have no bins of them.
    """
    import xarray as xr

    found = xr.Dataset(
        {
            name: array.assign_attrs(units="1", long_name=long_name)
            for name, (array, long_name) in tables.items()
        }
    )
    if aspect is None:
        return found
    found.aspect_bin.attrs = {"long_name": "aspects pooled [deg]"}
    _, index = aspect_bins(aspect.values)
    lowest = [aspect.values[index == k].min() for k in range(index.max() + 1)]
    found["aspect_low"] = (
        "aspect_bin",
        [*lowest, np.nan],
        {"units": "degree", "long_name": "lowest aspect pooled; none of the whole"},
    )
    return found.set_coords("aspect_low")


# Unknown ships: answers that a test vigilance rejects

ENDS = {"_ci_low": "lower", "_ci_high": "upper"}
LEAST = np.array([0.0, 0.5, 0.8, 0.9, 0.95])  # shares of answers to unknown ships, to be rejected
MEANINGS = {
    "rejected_unknown": "fraction of answers to unknown ships that are rejected",
    "rejected_known": "fraction of answers to known ships that are rejected",
    "correct_known": "fraction of answers to known ships that are right and not rejected",
    "n_unknown": "answers to unknown ships",
    "n_known": "answers to known ships",
    "correct_where_rejected": "fraction of answers to known ships that are right and not rejected "
    "where at least so many of those to unknown ones are",
    "rejected_up_to": "largest cosine that must be rejected for that, none where all are accepted",
    "auroc": "probability that an answer to a known ship is more similar than one to an unknown "
    "ship (area under the receiver operating characteristic)",
    "oscr": "probability that an answer to a known ship is right and more similar than one to an "
    "unknown ship (area under the open-set classification rate)",
}


def tabulate_rejection(
    classified: xr.Dataset,
    known: xr.DataArray,
    aspects: Mapping[str, xr.DataArray],
    test_vigilances: tuple[float, ...],
) -> xr.Dataset:
    """Return the receiver operating characteristic of rejection by test vigilance.

    Of the `similarity` and `correct` of a classifier, (ship,) which it has learned, the others
    being unknown, (aspect,) flags of some kinds by name, and cosines below which a test answers
    "unknown": `MEANINGS` over the classifier's axes and `aspects`, NaN without answers; means over
    all draws, with `..._ci_low` and `..._ci_high`. `correct_where_rejected`,
    `rejected_up_to`, `auroc` and `oscr` are of the whole characteristic, for any test vigilances;
    see `ncti.evaluate.open_set_scores`.

    Notes
    -----
    The characteristic has a corner at every similarity of an answer to an unknown ship. To reject
    a share of these answers, all answers up to a quantile of the similarity are rejected.
    """
    import xarray as xr

    levels = np.array(test_vigilances)
    thresholds = xr.DataArray(levels, {"test_vigilance": levels}, ("test_vigilance",))
    similarity, right = classified.similarity, classified.correct == 1
    accepted = similarity >= thresholds
    draws = [name for name in DRAWS if name in right.dims]
    pooled = [*draws, *VIEW]
    parts = []
    for name, of_kind in aspects.items():
        of_known = (classified.correct >= 0) & known & of_kind
        of_unknown = similarity.notnull() & ~known & of_kind  # right or wrong
        up_to = _over(pooled, _quantiles, similarity, of_unknown, gives=["least_rejected"])
        up_to = up_to.assign_coords(least_rejected=LEAST)
        counted = {
            "rejected_unknown": (~accepted, of_unknown),
            "rejected_known": (~accepted, of_known),
            "correct_known": (accepted & right, of_known),
            "correct_where_rejected": ((similarity > up_to) & right, of_known & up_to.notnull()),
        }
        part = {"n_unknown": of_unknown.sum(pooled), "n_known": of_known.sum(pooled)}
        part["rejected_up_to"] = up_to.where(up_to > -np.inf)
        areas = _over(pooled, _areas, similarity, right, of_known, of_unknown, gives=["score"])
        part |= {name: areas.isel(score=k) for k, name in enumerate(("auroc", "oscr"))}
        for figure, (hits, answers) in counted.items():
            for suffix, values in zip(("", *ENDS), _share(hits, answers, draws), strict=True):
                part[figure + suffix] = values
        parts.append(xr.Dataset(part).expand_dims(aspects=[name]))
    table = xr.concat(parts, "aspects")
    said = MEANINGS | {
        "test_vigilance": "cosine that an answer must reach",
        "least_rejected": "fraction of answers to unknown ships that is rejected at least",
    }
    for name, meaning in said.items():
        table[name].attrs = {"units": "1", "long_name": meaning}
        for suffix, end in ENDS.items() if name + "_ci_low" in table else ():
            interval = f"{end} end of the 95 % Wilson interval of the {meaning}"
            table[name + suffix].attrs = {"units": "1", "long_name": interval}
    table.aspects.attrs = OF_ASPECTS
    return table


def _over(
    pooled: list[str], function: Callable[..., Any], *arrays: xr.DataArray, gives: Any = ()
) -> xr.DataArray:
    """Return the results of a function of pooled axes, at every place of the other axes."""
    import xarray as xr

    whole, made = [pooled] * len(arrays), [gives]
    found: xr.DataArray = xr.apply_ufunc(
        function, *arrays, input_core_dims=whole, output_core_dims=made, vectorize=True
    )
    return found


def _quantiles(similarity: Floats, unknown: Flags) -> Floats:
    """(least_rejected,): up to where answers go; -inf where none do, NaN without any."""
    ranked = np.sort(similarity[unknown])
    if not ranked.size:
        return np.where(LEAST > 0, np.nan, -np.inf)
    count = np.ceil(LEAST * ranked.size - 1e-9).astype(int)
    return np.where(count > 0, ranked[np.maximum(count - 1, 0)], -np.inf)


def _areas(similarity: Floats, right: Flags, known: Flags, unknown: Flags) -> Floats:
    """Return AUROC and OSCR of answers; NaN without any."""
    asked = known | unknown
    scores = open_set_scores(similarity[asked], right[asked], known[asked])
    return np.array([scores.auroc, scores.oscr])


def _share(
    hits: xr.DataArray, answers: xr.DataArray, draws: list[str]
) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """Return the fraction of answers that hit, and both ends of its interval."""
    import xarray as xr

    hits, answers = xr.broadcast(hits & answers, answers)
    n = answers.sum([*draws, *VIEW])
    fraction = hits.sum([*draws, *VIEW]) / n.where(n > 0)
    order = [*fraction.dims, *draws, *VIEW]
    score = replicated_accuracy(
        hits.transpose(*order).values,
        np.zeros(hits.sizes["aspect"]),  # all of them together
        draws=len(draws),
        answered=answers.transpose(*order).values,
    )
    low, high = score.ci_low[..., -1], score.ci_high[..., -1]
    return fraction, fraction.copy(data=low), fraction.copy(data=high)
