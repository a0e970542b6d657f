"""From the answers of classifiers to percent correct by aspect bin, with Wilson intervals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ncti.evaluate import accuracy_by_aspect, aspect_bins, replicated_accuracy
from sweeps.engine.settings import Choices
from sweeps.stages.classifier import learned_of

if TYPE_CHECKING:
    import xarray as xr

Scored: TypeAlias = "dict[str, tuple[xr.DataArray, str]]"
VIEW = ("ship", "aspect")
DRAWS = ("replicate", "draw")  # of the noise, over which accuracies are pooled

RECEIVER = "ladar.receiver"  # key; axes have names, and this is an attribute of tables
PROFILES = {
    "training_correct": ("training_", "training profiles"),
    "ship_correct": ("ship_", "ships of test profiles"),
    "correct": ("", "test profiles"),
}
"""Variables of answers about range profiles: prefix of their scores, and what is classified."""


def known_ships(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the answers about ships that are learned.

    Unknown ships cannot be named right: see `sweeps.stages.rejection`.
    """
    return classified.isel(ship=np.flatnonzero(learned_of(choices).any(axis=1)))


def tabulate_answers(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Tabulate the answers of a classifier about range profiles.

    Parameters
    ----------
    classified : xarray.Dataset
        Group of its answers.
    choices : Choices
        Of the sweep.

    Returns
    -------
    xarray.Dataset
        `accuracy` by aspect bin with `ci_low`, `ci_high` and `n`; the same with `training_`, and
        with `ship_` where ships alone are counted, if the classifier has them. Where it forms
        categories, `category_count`, `view_count` and `settled`, too.
    """
    known = known_ships(classified, choices)
    tables = formed(known, "training profiles") if "training_category" in known else {}
    for name, (prefix, what) in PROFILES.items():
        if name in known:
            tables |= scored(known[name], prefix, what)
    return data_set(tables, known.aspect).assign_attrs(receiver_of(choices))


def receiver_of(choices: Choices) -> dict[str, str]:
    """Return the receiver of all range profiles as an attribute; none where there are several."""
    receivers = choices.values.get(RECEIVER, ())
    return {"receiver": receivers[0]} if len(receivers) == 1 else {}


def formed(classified: xr.Dataset, what: str) -> Scored:
    """Return how many categories formed in every training, and of how many of what."""
    return {
        "category_count": (
            (classified.training_category.max(VIEW) + 1).astype("i4"),
            "categories formed",
        ),
        "view_count": ((classified.training_category >= 0).sum(VIEW).astype("i4"), what),
        "settled": ((classified.passes > 0).astype("i1"), "1 where the categories settled"),
    }


def scored(correct: xr.DataArray, prefix: str, what: str) -> Scored:
    """Return the fraction correct by aspect bin, whatever axes there are besides the view's.

    Parameters
    ----------
    correct : xarray.DataArray
        1 where an answer is right, 0 where not, negative where nothing was asked; (..., ship,
        aspect), with replicates or draws among the leading axes.
    prefix : str
        Prefix of the names.
    what : str
        What is classified.

    Returns
    -------
    dict of str to (DataArray, str)
        `accuracy`, `ci_low`, `ci_high` and `n`, each with its long name. The intervals take
        replicates for what they are: more looks at the same views.
    """
    # Imported where it is used: xarray takes a third of a second.
    import xarray as xr

    draws = tuple(name for name in DRAWS if name in correct.dims)
    answers = correct.transpose(..., *draws, *VIEW)
    score = (replicated_accuracy if draws else accuracy_by_aspect)(
        answers.values == 1, answers.aspect.values, answered=answers.values >= 0
    )
    gone = (*draws, *VIEW)
    coords: dict[Any, Any] = {
        name: coord for name, coord in answers.coords.items() if not {name, *coord.dims} & {*gone}
    }
    coords["aspect_bin"] = np.array(score.labels, dtype=object)
    dims = (*answers.dims[: -len(gone)], "aspect_bin")
    return {
        prefix + suffix: (xr.DataArray(values, coords, dims), long_name)
        for suffix, values, long_name in (
            ("accuracy", score.fraction, f"fraction of {what} classified correctly"),
            ("ci_low", score.ci_low, "lower end of its 95 % Wilson interval"),
            ("ci_high", score.ci_high, "upper end of its 95 % Wilson interval"),
            ("n", score.n, f"number of {what}"),
        )
    }


def data_set(
    tables: Mapping[str, tuple[xr.DataArray, str]], aspect: xr.DataArray | None
) -> xr.Dataset:
    """Return tables by aspect bin as a data set, each with its meaning.

    Parameters
    ----------
    tables : mapping of str to (DataArray, str)
        Tables, all numbers without unit, with their long names.
    aspect : xarray.DataArray or None
        Aspects [deg] that were pooled; none where tables have no bins of them.

    Returns
    -------
    xarray.Dataset
        With the lowest aspect of every bin as a coordinate.
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
