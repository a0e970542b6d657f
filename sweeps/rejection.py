"""Unknown ships: which answers a test vigilance takes back."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

ASPECTS = ("learned", "between")  # aspects that are learned, and those that are not
VIEW = ("ship", "aspect")


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
        and `n_known`, answers. NaN without answers. Means over replicates, phases and orders.
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
    over = [*draws, *VIEW]
    parts = []
    for name, aspects in zip(ASPECTS, (taught, ~taught), strict=True):
        of_known, of_unknown = there & known & aspects, there & ~known & aspects
        many_known, many_unknown = of_known.sum(over), of_unknown.sum(over)
        parts.append(
            xr.Dataset(
                {
                    "rejected_unknown": (~accepted & of_unknown).sum(over)
                    / many_unknown.where(many_unknown > 0),
                    "rejected_known": (~accepted & of_known).sum(over)
                    / many_known.where(many_known > 0),
                    "correct_known": (right & of_known).sum(over)
                    / many_known.where(many_known > 0),
                    "n_unknown": many_unknown,
                    "n_known": many_known,
                }
            ).expand_dims(aspects=np.array([name], dtype=object))
        )
    table = xr.concat(parts, "aspects")
    names = {
        "rejected_unknown": "fraction of answers to unknown ships that are rejected",
        "rejected_known": "fraction of answers to known ships that are rejected",
        "correct_known": "fraction of answers to known ships that are right and not rejected",
        "n_unknown": "answers to unknown ships",
        "n_known": "answers to known ships",
    }
    for name, meaning in names.items():
        table[name].attrs = {"units": "1", "long_name": meaning}
    table.test_vigilance.attrs = {"units": "1", "long_name": "cosine that an answer must reach"}
    table.aspects.attrs = {"long_name": "whether anything was learned at the aspect"}
    return table
