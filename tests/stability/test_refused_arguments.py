"""Invalid arguments are refused in one line that names the argument and its value."""

import re

import numpy as np
import pytest
from arguments import GOOD, found, refused

from ncti import classify, evaluate
from ncti.classify.between import cells
from ncti.classify.calibration import fit_outlier_fraction, fit_temperature_and_outliers
from ncti.classify.fusion import add_outliers
from ncti.features.profile import estimated_floor


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("path", GOOD)
def test_a_wrong_argument_is_named_with_its_value(path):
    function, good = found(path), GOOD[path]
    if path != "simulate.flight":  # a whole flight takes long
        function(**good)
    for name, value in refused(path):
        with pytest.raises(ValueError, match=rf"\b{name}\b") as caught:
            function(**good | {name: value})
        said = str(caught.value)
        assert "\n" not in said, (name, value)
        assert re.search(r"\b(must|known|needed|allowed)\b", said), said
        if isinstance(value, float | str):
            shown = {str(value)} if isinstance(value, str) else {str(value), f"{value:g}"}
            assert any(text in said for text in shown), (name, value, said)


# Values that are no array of the right kind

RNG = np.random.default_rng(0)
VIEWS, BINS = 12, 8
NAMES = np.repeat(["a", "b", "c"], 4)
ASPECTS = np.tile([0.0, 10.0, 20.0, 30.0], 3)
PROFILES = RNG.random((VIEWS, BINS)) + 0.1
BAND = np.full((VIEWS, 1, BINS), 0.25)
GAUSS = {"mean": PROFILES, "covariance": BAND, "labels": NAMES, "floor": PROFILES[:, :1]}
TEMPLATES = classify.GaussianTemplates(template_error=0.1).fit(**GAUSS, aspect=ASPECTS)
FOUND = classify.cluster(classify.Similarities.of(PROFILES), vigilance=0.9)
SCORES = RNG.normal(size=(VIEWS, VIEWS))
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

# Arrays of numbers, of labels and of flags among the good arguments of functions.
ARRAYS = {
    "classify.cluster": ("order",),
    "classify.label_posterior": ("scores", "labels"),
    "classify.Similarities.of": ("training", "tests"),
    "evaluate.aspect_bins": ("aspects",),
    "evaluate.category_formation": ("labels", "ships", "aspects"),
    "evaluate.open_set_scores": ("similarity", "correct", "known"),
    "evaluate.rejection_thresholds": ("similarity", "shares"),
    "evaluate.replicated_accuracy": ("correct", "aspects"),
    "evaluate.wilson_interval": ("successes", "trials"),
    "features.cyclic_similarity": ("a", "b"),
    "features.log_polar": ("mask",),
    "features.profile_vector": ("profile", "floor"),
    "features.segment": ("image", "contrast"),
}
# Each call with its arrays, all of them good.
CALLS = {
    path: (
        lambda path=path, **given: found(path)(**GOOD[path] | given),
        {name: GOOD[path][name] for name in names},
    )
    for path, names in ARRAYS.items()
} | {
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
    "temperature and outliers": (
        fit_temperature_and_outliers,
        {"scores": SCORES, "labels": NAMES, "truth": NAMES, "weight": np.ones(VIEWS)},
    ),
    "add_outliers": (
        add_outliers,
        {
            "scores": SCORES,
            "labels": NAMES,
            "outlier_fraction": np.full(VIEWS, 0.1),
        },
    ),
    "labels of categories": (FOUND.majority_labels, {"classes": np.repeat([0, 1, 2], 4)}),
    "accuracy": (
        evaluate.accuracy_by_aspect,
        {"correct": RIGHT, "aspects": ASPECTS[:4], "answered": ~RIGHT},
    ),
    "floor": (estimated_floor, {"profile": PROFILES}),
}


# Exceptions in which a value is valid: labels may be texts, some arguments None.
ALLOWED = {
    *((call, name, "texts") for call in CALLS for name in ("labels", "ships", "truth")),
    ("classify.Similarities.of", "tests", "none"),
    ("classify.cluster", "order", "none"),
    ("features.profile_vector", "floor", "none"),
}


def refusal(function, good, name, wrong):
    """Return the one-line ValueError of a call with one wrong argument, or None."""
    try:
        function(**good | {name: wrong})
    except ValueError as error:
        assert "\n" not in str(error)
        assert re.match(rf"({'|'.join(good)})\b", str(error)), str(error)
        return error
    return None


@pytest.mark.parametrize("call", CALLS)
def test_what_is_no_array_of_such_values_is_refused(call):
    """Estimators of vectors are excluded, as scikit-learn checks their arguments."""
    function, good = CALLS[call]
    function(**good)
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
