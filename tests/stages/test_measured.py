"""Classifiers name measured profiles as the library's do, and never name unknown ships."""

import warnings

import numpy as np
import pytest
from flight_sweeps import EXPERIMENT, read
from sklearn.exceptions import ConvergenceWarning

from ncti.classify import AdaptiveClusteringNetwork, CorrelationNeighbour, GainAnnealedNetwork
from ncti.evaluate import aspect_bins
from ncti.features import profile_vector
from sweeps.stages import classifier
from sweeps.stages.acn import profile_order
from sweeps.stages.measured import (
    KINDS,
    acn_settings,
    measured,
    trained_classifier,
    training_method,
)
from sweeps.stages.mnn import Mnn, mnn_settings

SHIPS, ASPECTS, BINS = ("a", "b", "c"), (0.0, 30.0, 60.0, 90.0), 120
VIEWS = (len(SHIPS), len(ASPECTS))
LEARNED, TEST, MEASURED = range(len(KINDS))
NAMES = ("acn", "mnn", "correlation")
ALL = np.ones(VIEWS, dtype=bool)


@pytest.fixture
def signatures():
    """Return random profiles above a floor, (ship, aspect, kind, bin).

    Tests have some noise, measured ones more. The last ship is not flown past.
    """
    rng = np.random.default_rng(3)
    learned = np.zeros((*VIEWS, BINS))
    learned[..., 20:100] = rng.exponential(1.0, (*VIEWS, 80))
    profiles = np.repeat(learned[:, :, None], len(KINDS), axis=2)
    for kind, scatter in ((TEST, 0.2), (MEASURED, 3.0)):
        noise = rng.normal(0, scatter, profiles[:, :, kind].shape)
        profiles[:, :, kind] += np.where(np.arange(BINS) % 119 == 0, 0.0, noise)
    profiles += 5.0
    profiles[2, :, MEASURED] = np.nan
    return profiles.astype(np.float32)


def training_views(name, **changes):
    """Return the training method of a classifier, with few epochs."""
    choices = read()
    names = (setting for setting in EXPERIMENT.declared if setting.key.startswith("classifier."))
    values = {setting.name: choices[setting][0] for setting in names}
    values |= {"name": name, "vigilance": 0.9, "epochs": 60} | changes
    of_mnn = {setting.key.rpartition(".")[2]: values[setting.name] for setting in Mnn.declared}
    values["mnn_settings"] = mnn_settings(**of_mnn)
    values["profile_order"] = profile_order(values["order"], 0)
    values["presentation"] = values["profile_order"]
    values["orders"] = values["order"]
    values["acn_settings"] = acn_settings(**{key: values[key] for key in acn_settings.arguments})
    return training_method(**{key: values[key] for key in training_method.arguments})


class Fixed:
    """Generator that always draws 11, below 2**32."""

    def integers(self, below):
        assert below == 2**32
        return 11


def named(signatures, name, unknown=None, **changes):
    """Return the answers of a classifier trained on synthetic signatures to all signatures."""
    known = signatures[:, :, LEARNED]
    learned = classifier.training_views(
        SHIPS, ASPECTS, unknown, classifier.AspectSelection(None, None, ())
    )
    trained = trained_classifier(
        training_views(name, **changes), known, ALL, learned, ASPECTS, Fixed()
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return measured(trained, signatures, ALL)


@pytest.mark.filterwarnings(f"ignore::{ConvergenceWarning.__module__}.ConvergenceWarning")
@pytest.mark.parametrize(
    ("name", "vigilance"), [("acn", 0.9), ("acn", 0.5), ("mnn", 0.9), ("correlation", 0.9)]
)
def test_answers_match_the_library(signatures, name, vigilance):
    answers = named(signatures, name, vigilance=vigilance)
    ship = np.repeat(np.arange(len(SHIPS)), len(ASPECTS))
    labels, group = aspect_bins(np.array(ASPECTS))
    classes = ship * len(labels) + np.tile(group, len(SHIPS))
    vectors = profile_vector(signatures[:, :, LEARNED].reshape(-1, BINS))
    trained = {
        "acn": AdaptiveClusteringNetwork(vigilance=vigilance, learning_rate=0.1),
        "mnn": GainAnnealedNetwork(
            epochs=60, learning_rate=0.015, tolerance=0.35, scaling="common", random_state=11
        ),
        "correlation": CorrelationNeighbour(),
    }[name].fit(vectors, classes if name == "mnn" else ship)
    wrong = 0
    for kind in range(len(KINDS)):
        answered = ship < 2 if kind == MEASURED else ship < len(SHIPS)
        tests = profile_vector(signatures[:, :, kind].reshape(-1, BINS)[answered])
        predicted = trained.predict(tests)
        right = predicted == (classes if name == "mnn" else ship)[answered]
        predicted = predicted // len(labels) if name == "mnn" else predicted
        ours = {key: values[kind].reshape(-1) for key, values in answers.items()}
        np.testing.assert_array_equal(ours["predicted"][answered], predicted)
        np.testing.assert_array_equal(ours["ship_correct"][answered], predicted == ship[answered])
        np.testing.assert_array_equal(ours["correct"][answered], right)
        assert np.all(ours["cell"][answered] == 1)
        assert all(np.all(values[~answered] == -1) for values in ours.values())
        wrong += np.sum(~right)
    assert wrong > 0  # so that answers that are always right would fail


@pytest.mark.parametrize("name", NAMES)
def test_unknown_ships_are_never_named(signatures, name):
    answers = named(signatures, name, unknown=("a",))
    assert not np.any(answers["predicted"] == 0)
    assert np.all(answers["correct"][:2, 0] == 0)
