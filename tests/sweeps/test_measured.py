"""Naming measured profiles: every classifier as the library has it, and who is asked."""

import numpy as np
import pytest
from sklearn.exceptions import ConvergenceWarning

from ncti.classify import AdaptiveClusteringNetwork, CorrelationNeighbour, GainAnnealedNetwork
from ncti.evaluate import aspect_bins
from ncti.features import profile_vector
from sweeps.classifier_schema import ClassifierConfig, NetworkConfig
from sweeps.flight_variables import KINDS
from sweeps.measured import name_measured

SHIPS, ASPECTS, FLIGHTS, BINS = 3, (0.0, 30.0, 60.0, 90.0), 2, 120
LEARNED, TEST, MEASURED = range(len(KINDS))
NAMES = ("acn", "mnn", "correlation")
SETTINGS = ClassifierConfig(name=list(NAMES), mnn=NetworkConfig(epochs=60))


@pytest.fixture
def signatures():
    """Ragged made profiles above a floor; tests with some noise, measured ones with more.

    The last ship is not flown past.
    """
    rng = np.random.default_rng(3)
    learned = np.zeros((SHIPS, len(ASPECTS), BINS))
    learned[..., 20:100] = rng.exponential(1.0, (SHIPS, len(ASPECTS), 80))
    found = np.repeat(learned[:, :, None, None], FLIGHTS, axis=2).repeat(len(KINDS), axis=3)
    for kind, scatter in ((TEST, 0.2), (MEASURED, 1.0)):
        noise = rng.normal(0, scatter, found[:, :, :, kind].shape)
        found[:, :, :, kind] += np.where(np.arange(BINS) % 119 == 0, 0.0, noise)
    found += 5.0
    found[2, :, :, MEASURED] = np.nan
    return found.astype(np.float32)


def named(signatures, there=None, learned=None, names=NAMES, vigilances=(0.9, 0.5)):
    everything = np.ones((SHIPS, len(ASPECTS)), dtype=bool)
    return name_measured(
        signatures,
        everything if there is None else there,
        aspects=ASPECTS,
        learned=everything if learned is None else learned,
        names=names,
        vigilances=vigilances,
        classifier=SETTINGS,
        random_state=11,
    )


@pytest.mark.filterwarnings(f"ignore::{ConvergenceWarning.__module__}.ConvergenceWarning")
def test_answers_are_those_of_the_library(signatures):
    answers = named(signatures)
    shape = (len(NAMES), 2, FLIGHTS, len(KINDS), SHIPS, len(ASPECTS))
    assert {name: values.shape for name, values in answers.items()} == dict.fromkeys(
        ("predicted", "correct", "ship_correct"), shape
    )
    ship = np.repeat(np.arange(SHIPS), len(ASPECTS))
    labels, group = aspect_bins(np.array(ASPECTS))
    classes = ship * len(labels) + np.tile(group, SHIPS)
    vectors = profile_vector(signatures[:, :, 0, LEARNED].reshape(-1, BINS))
    networks = [
        AdaptiveClusteringNetwork(vigilance=vigilance, learning_rate=0.1).fit(vectors, ship)
        for vigilance in (0.9, 0.5)
    ]
    multilayered = GainAnnealedNetwork(
        epochs=60, learning_rate=0.015, tolerance=0.35, scaling="common", random_state=11
    ).fit(vectors, classes)
    neighbour = CorrelationNeighbour().fit(vectors, ship)
    wrong = 0
    for flight, kind in np.ndindex(FLIGHTS, len(KINDS)):
        asked = ship < 2 if kind == MEASURED else ship < SHIPS
        seen = profile_vector(signatures[:, :, flight, kind].reshape(-1, BINS)[asked])
        for v, network in enumerate(networks):
            by_mnn = multilayered.predict(seen)
            for k, (name, right) in enumerate(
                (
                    (network.predict(seen), ship[asked]),
                    (by_mnn // len(labels), None),
                    (neighbour.predict(seen), ship[asked]),
                )
            ):
                place = (k, v, flight, kind)
                ours = {one: values[place].reshape(-1) for one, values in answers.items()}
                np.testing.assert_array_equal(ours["predicted"][asked], name)
                np.testing.assert_array_equal(ours["ship_correct"][asked], name == ship[asked])
                true = by_mnn == classes[asked] if right is None else name == right
                np.testing.assert_array_equal(ours["correct"][asked], true)
                wrong += np.sum(~true)
                for values in ours.values():
                    assert np.all(values[~asked] == -1)
    assert wrong > 0  # the test would tell answers that are all right from ours


def test_measured_profiles_alike_to_the_learned_are_named_alike(signatures):
    signatures[:2, :, :, MEASURED] = 3 * (signatures[:2, :, :, LEARNED] - 5) + 70
    answers = named(signatures, names=("acn", "correlation"))
    np.testing.assert_array_equal(
        answers["predicted"][:, :, :, MEASURED, :2], answers["predicted"][:, :, :, LEARNED, :2]
    )
    assert np.all(answers["correct"][1, :, :, LEARNED] == 1)


def test_a_profile_of_nothing_names_no_ship(signatures):
    signatures[1, 2, :, MEASURED] = 5.0
    answers = named(signatures, names=("acn", "correlation"))
    assert np.all(answers["predicted"][:, :, :, MEASURED, 1, 2] == -1)
    assert np.all(answers["correct"][:, :, :, MEASURED, 1, 2] == 0)


def test_views_that_are_not_there_have_no_say(signatures):
    there = np.ones((SHIPS, len(ASPECTS)), dtype=bool)
    there[0, 1] = False
    signatures[0, 1] = np.nan
    answers = named(signatures, there=there, names=("correlation",))
    assert np.all(answers["correct"][..., 0, 1] == -1)
    assert np.all(answers["correct"][..., TEST, 1:, :] >= 0)


def test_unknown_ships_are_never_named(signatures):
    learned = np.ones((SHIPS, len(ASPECTS)), dtype=bool)
    learned[0] = False
    answers = named(signatures, learned=learned)
    assert not np.any(answers["predicted"] == 0)
    assert np.all(answers["correct"][..., :2, 0, :] == 0)


def test_one_flight_has_no_say_in_anothers_answers(signatures):
    both = named(signatures)
    alone = named(signatures[:, :, 1:])
    for name, values in both.items():
        np.testing.assert_array_equal(values[:, :, 1:], alone[name])
