"""Invalid arguments are refused in one line that names the argument and its value."""

import inspect
import re

import numpy as np
import pytest
from arguments import GOOD, OTHERS, WRONG, found, refused

from ncti import classify, evaluate


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("path", GOOD)
def test_refusal_names_the_argument_and_its_value(path):
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


def test_every_invalid_value_belongs_to_an_argument():
    taken = {name for path in GOOD for name in inspect.signature(found(path)).parameters}
    assert set(WRONG) <= taken and set(OTHERS) <= set(GOOD)


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
RIGHT = RNG.random((3, 4)) < 0.5

NUMBERS = {
    "ragged": [[0.5, 0.5], [0.5]],
    "text": "profiles",
    "texts": ["a"] * VIEWS,
    "objects": np.array([object()] * VIEWS),
    "none": None,
    "dates": np.full((VIEWS, BINS), np.datetime64("2024-01-01")),
    "a dictionary": {"a": 1},
    "complex": np.full((VIEWS, BINS), 1j),
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
METHODS = {
    "templates": (classify.GaussianTemplates(template_error=0.1).fit, GAUSS | {"aspect": ASPECTS}),
    "averages": (TEMPLATES.posterior, {"X": PROFILES, "frame_count": np.full(VIEWS, 4)}),
    "labels of categories": (FOUND.majority_labels, {"classes": np.repeat([0, 1, 2], 4)}),
    "accuracy": (
        evaluate.accuracy_by_aspect,
        {"correct": RIGHT, "aspects": ASPECTS[:4], "answered": ~RIGHT},
    ),
}
# Exceptions in which a value is valid: labels may be texts, some arguments None.
ALLOWED = {
    *((name, "texts") for name in ("labels", "ships")),
    *((name, "none") for name in ("tests", "order", "floor")),
}


def is_refused(function, good, name, wrong):
    """Return whether a call with one wrong argument raises a one-line ValueError about it."""
    try:
        function(**good | {name: wrong})
    except ValueError as error:
        assert "\n" not in str(error)
        assert re.match(rf"({'|'.join(good)})\b", str(error)), str(error)
        return True
    return False


@pytest.mark.parametrize("call", [*ARRAYS, *METHODS])
def test_invalid_arrays_are_refused(call):
    """Estimators of vectors are excluded, as scikit-learn checks their arguments."""
    function, good = METHODS[call] if call in METHODS else (found(call), GOOD[call])
    function(**good)
    for name in ARRAYS.get(call, good):
        value = np.asarray(good[name])
        wrong = dict(NUMBERS)
        if value.dtype.kind in "if":
            wrong["nan"] = np.full(value.shape, np.nan)
            wrong["infinite"] = np.full(value.shape, np.inf)
            wrong["a huge integer"] = np.full(value.shape, 10**400, dtype=object).tolist()
        for kind, values in wrong.items():
            if (name, kind) not in ALLOWED:
                assert is_refused(function, good, name, values), (name, kind)
        for shape in (value[:0], value[:-1], value[None, None, None]) if value.ndim else ():
            is_refused(function, good, name, shape)  # or computed
