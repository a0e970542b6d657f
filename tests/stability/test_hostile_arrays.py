"""What is no array of the right kind is refused in one sentence that names the parameter."""

import re

import numpy as np
import pytest

from ncti import classify, evaluate, features
from ncti.classify.between import cells
from ncti.classify.calibration import fit_outlier_fraction, fit_temperature_and_outliers
from ncti.classify.fusion import with_outliers
from ncti.features.profile import estimated_floor

RNG = np.random.default_rng(0)
VIEWS, BINS = 12, 8
NAMES = np.repeat(["a", "b", "c"], 4)
ASPECTS = np.tile([0.0, 10.0, 20.0, 30.0], 3)
PROFILES = RNG.random((VIEWS, BINS)) + 0.1
BAND = np.full((VIEWS, 1, BINS), 0.25)
SCORES = RNG.normal(size=(VIEWS, VIEWS))
TEMPLATES = classify.GaussianTemplates(template_error=0.1).fit(
    PROFILES, BAND, NAMES, PROFILES[:, :1], aspect=ASPECTS
)
LEARNED = classify.Similarities.of(PROFILES)
FOUND = classify.cluster(LEARNED, vigilance=0.9)
RIGHT = RNG.random((3, 4)) < 0.5

RAGGED = [[0.5, 0.5], [0.5]]
NUMBERS = {
    "ragged": RAGGED,
    "text": "profiles",
    "texts": ["a"] * VIEWS,
    "objects": np.array([object()] * VIEWS),
    "none": None,
    "dates": np.full((VIEWS, BINS), np.datetime64("2024-01-01")),
    "a dictionary": {"a": 1},
    "complex": np.full((VIEWS, BINS), 1j),
}
UNBOUNDED = {
    "nan": lambda good: np.full_like(np.asarray(good, float), np.nan),
    "infinite": lambda good: np.full_like(np.asarray(good, float), np.inf),
    "a huge integer": lambda good: np.full(np.shape(good), 10**400, dtype=object).tolist(),
}
SHAPES = {
    "empty": lambda good: np.asarray(good)[:0],
    "a number too few": lambda good: np.asarray(good)[:-1],
    "too deep": lambda good: np.asarray(good)[None, None, None],
}


GAUSS = {"mean": PROFILES, "covariance": BAND, "labels": NAMES, "floor": PROFILES[:, :1]}
PAIRS = {"scores": SCORES, "labels": NAMES, "truth": NAMES}

# Each call with good arguments, and which of them are arrays of numbers, of labels, of flags.
CALLS = {
    "templates": (
        lambda **given: classify.GaussianTemplates(template_error=0.1).fit(**given),
        GAUSS | {"aspect": ASPECTS},
    ),
    "averages": (TEMPLATES.posterior, {"X": PROFILES, "frame_count": np.full(VIEWS, 4)}),
    "without": (TEMPLATES.without, {"left_out": np.arange(VIEWS) < 2}),
    "outlier_fraction": (
        lambda **given: fit_outlier_fraction(TEMPLATES, rng=np.random.default_rng(0), **given),
        {"frame_count": 4},
    ),
    "lower band": (classify.lower_band, {"covariance": np.stack([np.eye(3)] * 2)}),
    "cells": (
        cells,
        {"mean": PROFILES, "labels": NAMES, "aspect": ASPECTS, "correlation": np.eye(1, BINS)[0]},
    ),
    "posterior": (
        lambda **given: classify.label_posterior(**given)[1],
        {"scores": SCORES, "labels": NAMES},
    ),
    "temperature and outliers": (
        fit_temperature_and_outliers,
        PAIRS | {"weight": np.ones(VIEWS)},
    ),
    "with_outliers": (
        with_outliers,
        {"scores": SCORES, "labels": NAMES, "outlier_fraction": np.full(VIEWS, 0.1)},
    ),
    "similarities": (classify.Similarities.of, {"training": PROFILES, "tests": PROFILES}),
    "clustering": (
        lambda **given: classify.cluster(LEARNED, vigilance=0.9, **given),
        {"order": np.arange(VIEWS)},
    ),
    "names of categories": (FOUND.names, {"classes": np.repeat([0, 1, 2], 4)}),
    "interval": (evaluate.wilson_interval, {"successes": [3, 4], "trials": [5, 6]}),
    "aspects": (evaluate.aspect_bins, {"aspects": ASPECTS}),
    "accuracy": (
        evaluate.accuracy_by_aspect,
        {"correct": RIGHT, "aspects": ASPECTS[:4], "answered": ~RIGHT},
    ),
    "replicates": (
        evaluate.replicated_accuracy,
        {"correct": np.stack([RIGHT] * 2), "aspects": ASPECTS[:4], "answered": True},
    ),
    "open set": (
        evaluate.open_set_scores,
        {"similarity": PROFILES[:, 0], "correct": NAMES == "a", "known": NAMES != "c"},
    ),
    "rejection": (
        evaluate.rejection_thresholds,
        {"similarity": PROFILES[:, 0], "shares": np.array([0.0, 0.5])},
    ),
    "formation": (
        evaluate.category_formation,
        {
            "labels": np.arange(12),
            "ships": NAMES,
            "aspects": ASPECTS,
        },
    ),
    "profile vector": (features.profile_vector, {"profile": PROFILES, "floor": PROFILES[:, 0]}),
    "floor": (estimated_floor, {"profile": PROFILES}),
    "log-polar": (features.log_polar, {"mask": np.ones((5, 5))}),
    "cyclic": (
        features.cyclic_similarity,
        {"a": np.ones((2, 4, 4)), "b": np.ones((2, 4, 4))},
    ),
    "segment": (
        lambda **given: features.segment(target_sigma=0.1, sea_sigma=0.1, **given),
        {"image": np.pad(np.ones((2, 2)), 3), "contrast": 1.0},
    ),
}


# Where what is wrong elsewhere is right: labels may be texts, and some arguments missing.
ALLOWED = {
    *((call, name, "texts") for call in CALLS for name in ("labels", "ships", "truth")),
    ("similarities", "tests", "none"),
    ("clustering", "order", "none"),
    ("profile vector", "floor", "none"),
}


def refusal(function, good, name, wrong):
    """The error of a call with one wrong argument, a ValueError of one line; None without one."""
    try:
        function(**good | {name: wrong})
    except ValueError as error:
        assert "\n" not in str(error)
        assert re.match(rf"({'|'.join(good)})\b", str(error)), str(error)
        return error
    return None


@pytest.mark.parametrize("call", CALLS)
def test_good_arguments_are_taken(call):
    function, good = CALLS[call]
    function(**good)


@pytest.mark.parametrize("call", CALLS)
def test_what_is_no_array_of_such_values_is_refused(call):
    """Estimators of vectors leave that to scikit-learn's own checks and words."""
    function, good = CALLS[call]
    for name, value in good.items():
        numbers = np.asarray(value).dtype.kind in "if"
        changed = {kind: change(value) for kind, change in UNBOUNDED.items() if numbers}
        for kind, wrong in (NUMBERS | changed).items():
            if (call, name, kind) not in ALLOWED:
                assert refusal(function, good, name, wrong) is not None, (name, kind)


@pytest.mark.parametrize("call", CALLS)
def test_other_shapes_are_computed_or_refused(call):
    function, good = CALLS[call]
    for name, value in good.items():
        for change in SHAPES.values():
            if np.ndim(value):
                refusal(function, good, name, change(value))


def test_counts_beyond_integers_are_refused():
    with pytest.raises(ValueError, match=r"^frame_count is inf"):
        TEMPLATES.posterior(PROFILES, 10**400)
    with pytest.raises(ValueError, match=r"^draws is -1"):
        evaluate.replicated_accuracy(RIGHT, ASPECTS[:4], draws=-1)
