"""Training and testing the classifier on the profiles of one cell, and its tables."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning

from ncti.classify import AdaptiveClusteringNetwork
from ncti.evaluate import accuracy_by_aspect, aspect_bins
from ncti.features import profile_vector
from sweeps.schema import ClassifierConfig

Arrays = dict[str, NDArray[Any]]
NONE = -1  # of a category, a ship, or an answer: the view is not there


def classify_cell(
    expected: NDArray[np.float32],
    averaged: NDArray[np.float32],
    there: NDArray[np.bool_],
    *,
    vigilances: tuple[float, ...],
    classifier: ClassifierConfig,
) -> Arrays:
    """Train on expected profiles, test on averaged ones, at every vigilance.

    Parameters
    ----------
    expected : (ship, aspect, bin) float32 ndarray
        Training profiles.
    averaged : (frame_count, ship, aspect, bin) float32 ndarray
        Test profiles of the same views.
    there : (ship, aspect) bool ndarray
        Views that are done; the others are left out.
    vigilances : tuple of float
        Vigilances in training.
    classifier : ClassifierConfig
        The rest of the classifier.

    Returns
    -------
    dict of str to ndarray
        training_category, training_correct : (vigilance, ship, aspect)
        category, predicted, correct : (vigilance, frame_count, ship, aspect)
        passes : (vigilance,), negative where the categories did not settle
    """
    ship = np.nonzero(there)[0]
    training = profile_vector(expected[there])
    test = profile_vector(averaged[:, there])

    lead, trained = (len(vigilances),), (len(vigilances), *there.shape)
    tested = (*lead, len(averaged), *there.shape)
    result: Arrays = {
        "training_category": np.full(trained, NONE, dtype=np.int32),
        "training_correct": np.full(trained, NONE, dtype=np.int8),
        "category": np.full(tested, NONE, dtype=np.int32),
        "predicted": np.full(tested, NONE, dtype=np.int16),
        "correct": np.full(tested, NONE, dtype=np.int8),
        "passes": np.zeros(lead, dtype=np.int32),
    }
    for v, vigilance in enumerate(vigilances):
        network = AdaptiveClusteringNetwork(
            vigilance=vigilance,
            learning_rate=classifier.learning_rate,
            max_passes=classifier.max_passes,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # `passes` and the table tell
            network.fit(training, ship)
        result["passes"][v] = network.n_passes_ if network.converged_ else -network.n_passes_
        result["training_category"][v, there] = network.labels_
        named = _names(network, network.labels_)
        result["training_correct"][v, there] = named == ship
        for f, vectors in enumerate(test):
            category, _ = network.match(vectors, learning=classifier.learn_in_test)
            named = _names(network, category)
            result["category"][v, f, there] = category
            result["predicted"][v, f, there] = named
            result["correct"][v, f, there] = named == ship
    return result


def _names(network: AdaptiveClusteringNetwork, category: NDArray[np.intp]) -> NDArray[np.intp]:
    """Ship of each category; none for a vector that matches nothing."""
    return np.where(category >= 0, network.category_labels_[np.maximum(category, 0)], NONE)


def tabulate(classified: xr.Dataset) -> xr.Dataset:
    """Categories formed, and percent correct by aspect bin, with Wilson intervals.

    Parameters
    ----------
    classified : xarray.Dataset
        The store's classification group.

    Returns
    -------
    xarray.Dataset
        `category_count`, `view_count` and `settled` for every training; `training_accuracy`
        and `accuracy` by aspect bin, with `..._ci_low`, `..._ci_high` and `..._n`.
    """
    there = classified.training_category >= 0
    views = there.sum(("ship", "aspect"))
    tables = {
        "category_count": (
            (classified.training_category.max(("ship", "aspect")) + 1).astype("i4"),
            "categories formed",
        ),
        "view_count": (views.astype("i4"), "training profiles"),
        "settled": ((classified.passes > 0).astype("i1"), "1 where the categories settled"),
    }
    for prefix, name in (("training_", "training_correct"), ("", "correct")):
        correct = classified[name].transpose(..., "ship", "aspect")
        score = accuracy_by_aspect(
            correct.values == 1, classified.aspect.values, answered=correct.values >= 0
        )
        coords: dict[Any, Any] = {dim: correct[dim] for dim in correct.dims[:-2]}
        coords["aspect_bin"] = np.array(score.labels, dtype=object)
        dims = (*correct.dims[:-2], "aspect_bin")
        what = "training profiles" if prefix else "test profiles"
        for suffix, values, long_name in (
            ("accuracy", score.fraction, f"fraction of {what} classified correctly"),
            ("ci_low", score.ci_low, "lower end of its 95 % Wilson interval"),
            ("ci_high", score.ci_high, "upper end of its 95 % Wilson interval"),
            ("n", score.n, f"number of {what}"),
        ):
            tables[prefix + suffix] = (xr.DataArray(values, coords, dims), long_name)
    dataset = xr.Dataset(
        {
            name: array.assign_attrs(units="1", long_name=long_name)
            for name, (array, long_name) in tables.items()
        }
    )
    dataset.aspect_bin.attrs = {"long_name": "aspects pooled [deg]"}
    _, index = aspect_bins(classified.aspect.values)
    lowest = [classified.aspect.values[index == k].min() for k in range(index.max() + 1)]
    dataset["aspect_low"] = (
        "aspect_bin",
        [*lowest, np.nan],
        {"units": "degree", "long_name": "lowest aspect pooled; none of the whole"},
    )
    return dataset.set_coords("aspect_low")
