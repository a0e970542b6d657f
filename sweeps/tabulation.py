"""From every answer in a store to its tables.

tables/acn                categories formed, percent correct by aspect bin
tables/acn_infrared       the same of silhouettes, with their spread over phases and orders
tables/detection          probability that the infrared detector finds the ship
tables/super_resolution   error of an image by how it gets finer than the detector
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from ncti.evaluate import (
    accuracy_by_aspect,
    aspect_bins,
    replicated_accuracy,
    wilson_interval,
)

DRAWS = ("phase", "order")  # what infrared scores are averaged over

Table = dict[str, tuple[xr.DataArray, str]]


def tabulate_profiles(classified: xr.Dataset) -> xr.Dataset:
    """Categories formed, and percent correct by aspect bin, with Wilson intervals.

    Parameters
    ----------
    classified : xarray.Dataset
        The store's group of classified profiles.

    Returns
    -------
    xarray.Dataset
        `category_count`, `view_count` and `settled` for every training; `training_accuracy`
        and `accuracy` by aspect bin, with `..._ci_low`, `..._ci_high` and `..._n`.
    """
    tables = _formed(classified, "training profiles")
    for prefix, name, what in (
        ("training_", "training_correct", "training profiles"),
        ("", "correct", "test profiles"),
    ):
        tables |= _scored(classified[name], prefix, what)
    return _dataset(tables, classified.aspect)


def tabulate_answers(classified: xr.Dataset) -> xr.Dataset:
    """Percent correct by aspect bin of a classifier that forms no categories.

    Parameters
    ----------
    classified : xarray.Dataset
        The store's group of its answers.

    Returns
    -------
    xarray.Dataset
        `accuracy` by aspect bin with `ci_low`, `ci_high` and `n`; the same with `training_`, and
        with `ship_` where ships alone are counted, if the classifier has them.
    """
    tables: Table = {}
    for prefix, name, what in (
        ("training_", "training_correct", "training profiles"),
        ("ship_", "ship_correct", "ships of test profiles"),
        ("", "correct", "test profiles"),
    ):
        if name in classified:
            tables |= _scored(classified[name], prefix, what)
    return _dataset(tables, classified.aspect)


def tabulate_silhouettes(classified: xr.Dataset) -> xr.Dataset:
    """The tables of `tabulate_profiles` for silhouettes, averaged over phases and orders.

    Parameters
    ----------
    classified : xarray.Dataset
        The store's group of classified silhouettes.

    Returns
    -------
    xarray.Dataset
        As of `tabulate_profiles`. Accuracies are means over the phases and orders that have
        answers, with `..._spread`, their standard deviation; both are NaN where none has.
        Intervals are those of the mean for `..._n` answers, the views of one phase and order:
        all of them see the same views, and more looks at a view are no more views.
    """
    tables = _formed(classified, "training silhouettes")
    for prefix, name, what in (
        ("training_", "training_correct", "training silhouettes"),
        ("", "correct", "test silhouettes"),
    ):
        scored = _scored(classified[name], prefix, what)
        fraction = scored[prefix + "accuracy"][0]
        # A training that failed has no answers, and any other has those of all views there are.
        n = scored[prefix + "n"][0].max(DRAWS)
        mean = fraction.mean(DRAWS)
        low, high = wilson_interval((mean.fillna(0) * n).clip(0, n), n)
        tables |= {
            prefix + "accuracy": (mean, f"mean {scored[prefix + 'accuracy'][1]}"),
            prefix + "spread": (
                fraction.std(DRAWS),
                f"standard deviation of that fraction over {' and '.join(DRAWS)}",
            ),
            prefix + "ci_low": (mean.copy(data=low), scored[prefix + "ci_low"][1]),
            prefix + "ci_high": (mean.copy(data=high), scored[prefix + "ci_high"][1]),
            prefix + "n": (n, scored[prefix + "n"][1]),
        }
    return _dataset(tables, classified.aspect)


def tabulate_images(images: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset]:
    """How often ships are found, and how good super-resolved images are.

    Parameters
    ----------
    images : xarray.Dataset
        The store's infrared group.

    Returns
    -------
    detection : xarray.Dataset
        `probability` by aspect bin, mean over ships, aspects and phases; `lowest`, the least
        of all views. Views that are not there are left out; NaN where none is.
    super_resolution : xarray.Dataset
        `error`, mean over ships, aspects and phases, and `error_spread`, over them; without
        views, or images without contrast, as before.
    """
    # Neither depends on how silhouettes are cut out, mapped and learnt.
    kept = {*images.dims, "coverage_rule"}
    images = images.drop_vars([name for name in images.coords if name not in kept])
    found = images.detection_probability
    labels, index = aspect_bins(images.aspect.values)
    bins = [*(np.flatnonzero(index == k) for k in range(len(labels))), np.arange(len(index))]
    over = ("ship", "aspect", "phase")
    pooled = [found.isel(aspect=chosen) for chosen in bins]
    name = xr.Variable("aspect_bin", np.array([*labels, "overall"], dtype=object))
    detection: Table = {
        "probability": (
            xr.concat([part.mean(over) for part in pooled], name),
            "mean probability that some pixel of the ship passes the threshold",
        ),
        "lowest": (
            xr.concat([part.min(over) for part in pooled], name),
            "least probability of a view",
        ),
    }
    error = images.reconstruction_error
    restored: Table = {
        "error": (error.mean(over), "rms difference from the noiseless fine image over contrast"),
        "error_spread": (error.std(over), "standard deviation of that over views and phases"),
    }
    return _dataset(detection, images.aspect), _dataset(restored, None)


def _formed(classified: xr.Dataset, what: str) -> Table:
    """How many categories formed in every training."""
    view = ("ship", "aspect")
    return {
        "category_count": (
            (classified.training_category.max(view) + 1).astype("i4"),
            "categories formed",
        ),
        "view_count": ((classified.training_category >= 0).sum(view).astype("i4"), what),
        "settled": ((classified.passes > 0).astype("i1"), "1 where the categories settled"),
    }


def _scored(correct: xr.DataArray, prefix: str, what: str) -> Table:
    """Fraction correct by aspect bin, whatever axes there are besides the view's."""
    draws = tuple(name for name in ("replicate", "draw") if name in correct.dims)
    answers = correct.transpose(..., *draws, "ship", "aspect")
    score = (replicated_accuracy if draws else accuracy_by_aspect)(
        answers.values == 1, answers.aspect.values, answered=answers.values >= 0
    )
    gone = (*draws, "ship", "aspect")
    coords: dict[Any, Any] = {
        name: coord for name, coord in answers.coords.items() if name not in gone
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


def _dataset(tables: Table, aspect: xr.DataArray | None) -> xr.Dataset:
    """A data set of tables, each with its meaning, and with the lowest aspect of every bin."""
    dataset = xr.Dataset(
        {
            name: array.assign_attrs(units="1", long_name=long_name)
            for name, (array, long_name) in tables.items()
        }
    )
    if aspect is None:
        return dataset
    dataset.aspect_bin.attrs = {"long_name": "aspects pooled [deg]"}
    _, index = aspect_bins(aspect.values)
    lowest = [aspect.values[index == k].min() for k in range(index.max() + 1)]
    dataset["aspect_low"] = (
        "aspect_bin",
        [*lowest, np.nan],
        {"units": "degree", "long_name": "lowest aspect pooled; none of the whole"},
    )
    return dataset.set_coords("aspect_low")
