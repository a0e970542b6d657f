"""Tables of the rejection of unknown ships by a test vigilance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ncti.evaluate.answers import ASPECT_ATTRS, DRAWS, VIEW, accuracy_columns
from ncti.evaluate.open_set import open_set_scores, rejection_thresholds

if TYPE_CHECKING:
    import xarray as xr

INTERVAL_SUFFIXES = ("_ci_low", "_ci_high")
AT_ONCE = 2**20  # answers times levels of a vigilance in memory at a time
MIN_REJECTED = np.array([0.0, 0.5, 0.8, 0.9, 0.95])  # share of answers to unknown ships
MEANINGS = {
    "rejected_unknown": "fraction of answers to unknown ships that are rejected",
    "rejected_known": "fraction of answers to known ships that are rejected",
    "correct_known": "fraction of answers to known ships that are correct and accepted",
    "n_unknown": "answers to unknown ships",
    "n_known": "answers to known ships",
    "correct_where_rejected": "fraction of answers to known ships that are correct and accepted at "
    "the threshold that rejects `min_rejected` of the unknown ones",
    "rejected_up_to": "that threshold, the largest cosine rejected; none where all are accepted",
    "auroc": "probability that an answer to a known ship is more similar than one to an unknown "
    "ship (area under the receiver operating characteristic)",
    "oscr": "probability that an answer to a known ship is right and more similar than one to an "
    "unknown ship (area under the open-set classification rate)",
    "test_vigilance": "cosine that an answer must reach",
    "min_rejected": "minimum fraction of answers to unknown ships that must be rejected",
}


def tabulate_rejection(
    classified: xr.Dataset,
    known: xr.DataArray,
    aspects: Mapping[str, xr.DataArray],
    test_vigilances: tuple[float, ...],
) -> xr.Dataset:
    """Return the receiver operating characteristic of rejection by test vigilance.

    Parameters
    ----------
    classified : xarray.Dataset
        `similarity` and `correct` of answers over ship, aspect and others.
    known : (ship,) xarray.DataArray of bool
        Ships that are learned; the others are unknown.
    aspects : mapping of str to (aspect,) xarray.DataArray of bool
        Kinds of aspects, tabulated apart.
    test_vigilances : tuple of float
        Similarities below which a test answers "unknown".

    Returns
    -------
    xarray.Dataset
        `MEANINGS` over the classifier's axes and `aspects`, NaN without answers; means over all
        draws, with `..._ci_low` and `..._ci_high`. `correct_where_rejected`, `rejected_up_to`,
        `auroc` and `oscr` are of the whole characteristic, for any test vigilances.

    See Also
    --------
    open_set_scores, rejection_thresholds : Figures of the whole characteristic.
    tabulate_scores : Percent correct without rejection.

    Examples
    --------
    One known ship and one unknown, at two aspects:

    >>> import xarray as xr
    >>> from ncti.evaluate import tabulate_rejection
    >>> similarity = xr.DataArray([[0.9, 0.7], [0.8, 0.3]], dims=("ship", "aspect"))
    >>> correct = xr.DataArray([[1, 1], [0, 0]], dims=("ship", "aspect"))
    >>> answers = xr.Dataset({"similarity": similarity, "correct": correct})
    >>> known = xr.DataArray([True, False], dims="ship")
    >>> aspects = {"learned": xr.DataArray([True, True], dims="aspect")}
    >>> table = tabulate_rejection(answers, known, aspects, (0.0, 0.85)).sel(aspects="learned")
    >>> table.rejected_unknown.values.tolist(), table.correct_known.values.tolist()
    ([0.0, 1.0], [1.0, 0.5])
    >>> float(table.auroc)
    0.75
    """
    import xarray as xr

    tested = np.array(test_vigilances)
    vigilance = xr.DataArray(tested, {"test_vigilance": tested}, ("test_vigilance",))
    similarity, right = classified.similarity.compute(), classified.correct == 1
    answered = classified.correct >= 0

    def rejected(level: xr.DataArray) -> xr.DataArray:
        return ~(similarity >= level)

    pooled = [*(name for name in DRAWS if name in right.dims), *VIEW]
    parts = []
    for kind, mask in aspects.items():
        knowns = answered & known & mask
        unknowns = similarity.notnull() & ~known & mask  # right or wrong
        all_similarity = similarity.where(knowns | unknowns)
        apply = partial(xr.apply_ufunc, vectorize=True)
        up_to = apply(
            lambda answers: rejection_thresholds(answers[~np.isnan(answers)], MIN_REJECTED),
            similarity.where(unknowns),
            input_core_dims=[pooled],
            output_core_dims=[["min_rejected"]],
        ).assign_coords(min_rejected=MIN_REJECTED)
        pools: Any = {"input_core_dims": [pooled] * 3, "output_core_dims": [[], []]}
        auroc, oscr = apply(_areas, all_similarity, right, knowns, **pools)
        columns = {
            "n_unknown": unknowns.sum(pooled),
            "n_known": knowns.sum(pooled),
            "rejected_up_to": up_to.where(up_to > -np.inf).astype(similarity.dtype),
            "auroc": auroc,
            "oscr": oscr,
        }
        for name, levels, hits, counted in (
            ("rejected_unknown", vigilance, rejected, unknowns),
            ("rejected_known", vigilance, rejected, knowns),
            ("correct_known", vigilance, lambda level: ~rejected(level) & right, knowns),
            ("correct_where_rejected", up_to, lambda level: (similarity > level) & right, knowns),
        ):
            share = _score_levels(levels, hits, counted, name)
            columns[name] = share[f"{name}_accuracy"]
            columns |= {name + end: share[name + end] for end in INTERVAL_SUFFIXES}
        parts.append(xr.Dataset(columns).expand_dims(aspects=[kind]))
    table = xr.concat(parts, "aspects")
    for name, meaning in MEANINGS.items():
        table[name].attrs = {"units": "1", "long_name": meaning}
        for ending, end in zip(INTERVAL_SUFFIXES, ("lower", "upper"), strict=True):
            if name + ending in table:
                interval = f"{end} end of the 95 % Wilson interval of the {meaning}"
                table[name + ending].attrs = {"units": "1", "long_name": interval}
    table.aspects.attrs = ASPECT_ATTRS
    return table


def _score_levels(
    levels: xr.DataArray,
    hits: Callable[[xr.DataArray], xr.DataArray],
    answered: xr.DataArray,
    name: str,
) -> xr.Dataset:
    """Return `accuracy_columns` pooled over aspects at each level; NaN where the level is NaN.

    `hits` returns the mask of hits at given levels, and `answered` masks the answers. Levels, on
    the last axis of `levels`, are scored in blocks.
    """
    import xarray as xr

    dim = str(levels.dims[-1])
    step, parts = max(1, AT_ONCE // max(answered.size, 1)), []
    for first in range(0, levels.sizes[dim], step):
        level = levels.isel({dim: slice(first, first + step)})
        hit, counted = xr.broadcast(hits(level), answered & level.notnull())
        # One common aspect pools them all.
        answers = hit.astype("i1").where(counted, np.int8(-1))
        answers = answers.assign_coords(aspect=np.zeros(hit.sizes["aspect"]))
        parts.append(
            accuracy_columns(answers, f"{name}_", name).sel(aspect_bin="overall", drop=True)
        )
    return xr.concat(parts, dim) if len(parts) > 1 else parts[0]


def _areas(similarity: Any, right: Any, known: Any) -> tuple[float, float]:
    """Return AUROC and OSCR of answers, NaN without any; a NaN similarity is no answer."""
    answered = ~np.isnan(similarity)
    scores = open_set_scores(similarity[answered], right[answered], known[answered])
    return scores.auroc, scores.oscr
