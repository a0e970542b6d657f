"""Range profiles of one cell that are made up, and their classifiers by name."""

from dataclasses import replace

import numpy as np

from sweeps.classifier_schema import ClassifierConfig, NetworkConfig
from sweeps.naming import Profiles, name_by_correlation, name_by_likelihood, name_by_network

SHIPS = 3
# Both sides of every edge between aspect groups, and their numbers.
ASPECTS = (0.0, 29.9, 30.0, 59.9, 60.0, 90.0)
GROUP = np.array([0, 0, 1, 1, 2, 2])
FRAMES = (4, 16)
REPLICATES = 3
BINS = 60
EDGE = 5  # bins at either end, 8 % of them, that no ship reaches
FLOOR = 5.0
VIEWS = SHIPS * len(ASPECTS)
SEED = 100

# Of one frame, with noise in two neighbouring bins and a variance that differs between views.
BAND = np.array([1.0, 0.4, 0.1])


def made(noise=0.3, seed=0):
    """Profiles of distinct views on a floor, and averages with white noise."""
    rng = np.random.default_rng(seed)
    expected = np.full((VIEWS, BINS), FLOOR)
    expected[:, EDGE:-EDGE] += rng.exponential(size=(VIEWS, BINS - 2 * EDGE))
    deviation = noise / np.sqrt(np.array(FRAMES))[:, None, None]
    averaged = expected + deviation * rng.standard_normal((REPLICATES, len(FRAMES), VIEWS, BINS))
    there = np.ones((SHIPS, len(ASPECTS)), dtype=bool)
    return Profiles(
        expected.astype(np.float32), averaged.astype(np.float32), there, np.array(ASPECTS), FRAMES
    )


def bands(profiles, variance=0.1):
    """(view, lag, bin): a covariance of one frame for every view."""
    scale = variance * (1 + 0.01 * np.arange(len(profiles.expected)))
    whole = scale[:, None, None] * np.broadcast_to(BAND[:, None], (len(BAND), BINS))
    whole = whole.copy()
    for lag in range(1, len(BAND)):
        whole[:, lag, BINS - lag :] = 0
    return whole.astype(np.float32)


def dense(band):
    """The covariance that a band of lags stands for."""
    whole = np.diag(band[0].astype(np.float64))
    for lag in range(1, len(band)):
        beside = np.diag(band[lag, : BINS - lag].astype(np.float64), lag)
        whole += beside + beside.T
    return whole


def name_by(classifier, profiles, **settings):
    """Answers of a classifier by its name."""
    if classifier == "mnn":
        network = NetworkConfig(**{"epochs": 40, **settings})
        config = ClassifierConfig(mnn=network)
        return name_by_network(profiles, classifier=config, random_state=SEED)
    config = ClassifierConfig(**settings)
    if classifier == "correlation":
        return name_by_correlation(profiles, classifier=config)
    return name_by_likelihood(profiles, bands(profiles), classifier=config)


OF_A_SETTING = {"presentations", "hidden", "loss"}


def directions(profiles):
    """Profile vectors of unit length, from their definition."""
    values = np.asarray(profiles, dtype=np.float64)
    ends = np.concatenate([values[..., :EDGE], values[..., -EDGE:]], axis=-1)
    above = values - ends.mean(axis=-1, keepdims=True)
    return above / np.linalg.norm(above, axis=-1, keepdims=True)


def kept(profiles, there):
    """Some views of profiles, the others not there."""
    chosen = there[profiles.there]
    return replace(
        profiles,
        expected=profiles.expected[chosen],
        averaged=profiles.averaged[:, :, chosen],
        there=there,
    )


def of_tests(name):
    """Whether a variable is of the tests, not of the training."""
    return name not in OF_A_SETTING and not name.startswith("training_")
