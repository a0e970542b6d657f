"""Every key of the classifiers: what it may hold, and the sentence where it may not."""

from copy import deepcopy
from dataclasses import fields
from functools import lru_cache

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from sweeping import contents
from test_configuration import composed

from sweeps.app import explain, replace_axes
from sweeps.classifier_schema import CLASSIFIERS, ClassifierConfig, NetworkConfig
from sweeps.errors import ConfigurationError
from sweeps.prepare import prepare
from sweeps.schema import axis_keys

# Least and most of a key, and words that it may be.
NUMBERS = {"nugget": (1e-9, 1000)}
COUNTS = {"max_passes": (1, 1_000_000), "mnn.max_hidden": (1, 1000)}
SWITCH = "learn_in_test"
NUMBER_AXES = {
    "learning_rate": (1e-6, 1),
    "gain_sigma": (0, 1000),
    "mnn.learning_rate": (1e-6, 1000),
    "mnn.tolerance": (1e-6, 0.999),
    "test_vigilance": (0, 1),
}
COUNT_AXES = {"mnn.epochs": (1, 1_000_000), "mnn.grow_every": (1, 1_000_000)}
WORD_AXES = {
    "name": CLASSIFIERS,
    "label_rule": ("majority", "first"),
    "score_rule": ("ship", "category"),
    "training": ("expected", "noisy"),
    "mnn.inputs": ("raw", "floor_removed", "standardised"),
}
SWITCH_AXES = ("left_out", "mnn.annealing")
OF_THE_GRID = ("unknown", "training_aspect")  # ships and aspects of it, null by default
OURS = ("acn", "mnn", "correlation", "likelihood")


def wrong_numbers(low, high):
    """Values that no number of these bounds may have, and what is said of each."""
    bounds = f"from {low:g} to {high:g}"
    for value in ("nan", "inf", "-inf"):
        yield value, (value, bounds)
    for value in (-1.0, 0.0, low / 2, high * 2, 1e300):
        yield f"{value}", (f"{value}", bounds)
    for value, shown in (("warm", "warm"), ("true", "True"), ("''", "''"), ("{}", "{}")):
        yield value, (shown, "type float")
    for value in ("[]", f"[{high}]", f"[{high}, {high}]"):
        yield value, (value, "type float")
    yield "null", ("null", "must be given")


def wrong_counts(low, high):
    for value in (-1, low - 1, high + 1, 10**30):
        yield f"{value}", (f"{value}", f"from {low:g} to {high:g}")
    for value in ("2.5", "nan", "inf", "warm", "[]", f"[{low}]"):
        yield value, (value, "type integer")
    yield "true", ("True", "type integer")
    yield "null", ("null", "must be given")


def wrong_axes(low, high, least_wrong):
    bounds = f"at least {low:g} and at most {high:g}"
    for value in ("nan", "inf", "-inf"):
        yield value, (f"has {value}", bounds)
    for value in (-1, least_wrong, 2 * high, 10**30):
        yield f"{value}", (f"has {value}", bounds)
    for value, shown in (("warm", "'warm'"), ("''", "''"), ("true", "True"), ("null", "None")):
        yield value, (f"has {shown}", bounds)
        yield f"[{high}, {value}]", (f"has {shown}", bounds)
    yield f"[{high}, [{high}]]", (f"has [{high}]", bounds)
    yield f"[{high}, {2 * high}]", (f"has {2 * high}", bounds)
    yield "[]", ("empty", "at least one")
    yield f"[{high}, {float(high)}]", (f"has {float(high)} more than once", "must differ")
    yield "{}", ("(none)", "start, stop and step")
    yield f"{{start: {low}, stop: {high}}}", ("start, stop", "start, stop and step")
    yield f"{{start: {low}, stop: {high}, step: 0}}", (".step has 0", "above 0")
    yield f"{{start: {low}, stop: {high}, step: 1e-9}}", (".step is 1e-09", "at most 100000")


def wrong_count_axes(low, high):
    yield from wrong_axes(low, high, low - 1)
    for value in ("2.5", f"[{low}, 2.5]"):
        yield value, ("has 2.5", "whole number")


def wrong_words(*allowed):
    listed = f"one of {', '.join(allowed)}"
    for value in ("best", allowed[0].upper(), f"{allowed[0]} "):
        yield f"'{value}'", (f"has '{value}'", listed)
    for value, shown in (
        *(("''", "''"), ("0", "0"), ("nan", "nan"), ("true", "True"), ("null", "None")),
        *(("{a: 1}", "{'a': 1}"), (f"[[{allowed[0]}]]", f"['{allowed[0]}']")),
    ):
        yield value, (f"has {shown}", listed)
    yield f"[{allowed[0]}, best]", ("has 'best'", listed)
    yield f"[{allowed[0]}, {allowed[0]}]", (f"has '{allowed[0]}' more than once", "must differ")
    yield "[]", ("empty", "at least one")


def wrong_switches():
    for value, shown in (
        *(("0", "0"), ("1", "1"), ("2.5", "2.5"), ("nan", "nan"), ("null", "None")),
        *(("yes", "'yes'"), ("''", "''"), ("'true'", "'true'"), ("{}", "{}")),
    ):
        yield value, (f"has {shown}", "one of true, false")
        yield f"[true, {value}]", (f"has {shown}", "one of true, false")
    yield "[true, true]", ("has True more than once", "must differ")
    yield "[]", ("empty", "at least one")


TABLES = (
    (wrong_numbers, NUMBERS),
    (wrong_counts, COUNTS),
    (wrong_axes, {key: (*ends, ends[0] - 1e-7) for key, ends in NUMBER_AXES.items()}),
    (wrong_count_axes, COUNT_AXES),
    (wrong_words, WORD_AXES),
    (wrong_switches, {key: () for key in SWITCH_AXES}),
)
WRONG = [
    (f"classifier.{key}={value}", (f"classifier.{key}", *said))
    for wrong, table in TABLES
    for key, allowed in table.items()
    for value, said in wrong(*allowed)
]
WRONG += [
    (f"classifier.{SWITCH}={value}", (f"classifier.{SWITCH}", shown, "true or false"))
    for value, shown in (
        *(("maybe", "maybe"), ("2.5", "2.5"), ("nan", "nan"), ("''", "''")),
        *(("[true, false]", "[True, False]"), ("[]", "[]"), ("{}", "{}")),
    )
]
WRONG += [
    (f"classifier.unknown={value}", ("classifier.unknown", *said))
    for value, *said in (
        ("horne", "has 'horne'", "one of duncan, "),
        ("[duncan, horne]", "has 'horne'", "one of duncan, "),
        ("duncan", "every ship of grid.ship", "must leave one"),
        ("[duncan, duncan]", "has 'duncan' more than once", "must differ"),
        ("[]", "empty", "at least one"),
        *(
            (value, shown, "a ship, or a list of ships")
            for value, shown in (
                *(("7", "is 7"), ("nan", "is nan"), ("true", "is True"), ("{a: 1}", "{'a': 1}")),
                *(("[duncan, 7]", "['duncan', 7]"), ("[null]", "[None]"), ("[[duncan]]", "[['d")),
            )
        ),
        ("''", "has ''", "one of duncan, "),
    )
]
WRONG += [
    (f"classifier.training_aspect={value}", ("classifier.training_aspect", *said))
    for value, *said in (
        *(
            (value, f"has {shown}", "at least 0 and below 360")
            for value, shown in (
                *(("-3", "-3"), ("360", "360"), ("nan", "nan"), ("inf", "inf"), ("bow", "'bow'")),
                *(
                    ("true", "True"),
                    ("[0, null]", "None"),
                    ("[[0]]", "[0]"),
                    (f"{10**30}", "1"),
                    ("''", "''"),
                ),
            )
        ),
        ("1", "has 1", "one of grid.aspect"),
        ("[0, 4]", "has 4", "one of grid.aspect"),
        ("{start: 0, stop: 90, step: 2}", "has 2", "one of grid.aspect"),
        ("{start: 0, stop: 90}", "start, stop", "start, stop and step"),
        ("[3, 3.0]", "has 3.0 more than once", "must differ"),
        ("[]", "empty", "at least one"),
    )
]
WRONG += [
    (f"classifier.{SWITCH}=null", (f"classifier.{SWITCH}", "null", "must be given")),
    *(
        (f"classifier.mnn={value}", ("classifier.mnn", *shown, "epochs, grow_every"))
        for value, *shown in (("5", "5"), ("mnn", "mnn"), ("nan", "nan"), ("[1, 2]", "a list"))
    ),
    ("classifier.mnn=null", ("classifier.mnn", "null", "must be given")),
    ("classifier.mnn={nodes: 3}", ("classifier.mnn.nodes", "no key", "max_hidden")),
    ("classifier.nodes=3", ("classifier.nodes", "no key", "learning_rate")),
]


@lru_cache
def plain():
    """The configuration of a sweep of one ship."""
    return composed("grid.ship=duncan")


def configured(*overrides):
    """That configuration with other values, set as Hydra sets them."""
    config = deepcopy(plain())
    for override in OverridesParser.create().parse_overrides(replace_axes(list(overrides))):
        OmegaConf.update(config, override.key_or_group, override.value(), merge=True)
    return prepare(config).config


def sentence(*overrides):
    """What is said of wrong values."""
    with pytest.raises((ConfigurationError, HydraException, OmegaConfBaseException)) as caught:
        configured(*overrides)
    return explain(caught.value)


def value_of(config, key):
    """Every value of an axis of the classifiers, and the value of what is no axis."""
    group, _, name = f"classifier.{key}".rpartition(".")
    if f"{group}.{name}" in axis_keys():
        axes = config.classifier.expand()
        return getattr(axes, "mnn_learning_rate" if key == "mnn.learning_rate" else name)
    return getattr(config.classifier.mnn if group.endswith("mnn") else config.classifier, name)


def test_every_key_is_tried():
    axes = {*NUMBER_AXES, *COUNT_AXES, *WORD_AXES, *SWITCH_AXES, *OF_THE_GRID}
    tried = {*NUMBERS, *COUNTS, SWITCH, *axes}
    there = {field.name for field in fields(ClassifierConfig)} - {"mnn"}
    assert tried == there | {f"mnn.{field.name}" for field in fields(NetworkConfig)}
    assert {f"classifier.{key}" for key in axes} == {
        key for key in axis_keys() if key.startswith("classifier.")
    }


@pytest.mark.parametrize(("override", "said"), WRONG, ids=lambda value: str(value)[:60])
def test_a_wrong_value_is_refused_in_one_sentence(override, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = sentence(override, "store=s.zarr", "cache=cache")
    for word in said:
        assert word in told
    assert told.startswith(said[0])
    assert "\n" not in told and "full_key" not in told
    assert contents(tmp_path) == {}


@pytest.mark.parametrize("key", [*NUMBERS, *COUNTS])
def test_both_ends_of_a_number_are_allowed(key):
    for value in (NUMBERS | COUNTS)[key]:
        assert value_of(configured(f"classifier.{key}={value}"), key) == value


@pytest.mark.parametrize("key", [*NUMBER_AXES, *COUNT_AXES])
def test_both_ends_of_an_axis_are_allowed(key):
    ends = (NUMBER_AXES | COUNT_AXES)[key]
    config = configured(f"classifier.{key}=[{ends[0]},{ends[1]}]")
    assert value_of(config, key) == ends
    config = configured(f"classifier.{key}={{start: {ends[1]}, stop: {ends[1]}, step: 1}}")
    assert value_of(config, key) == ends[1:]


@pytest.mark.parametrize("key", [key for key in WORD_AXES if key != "name"])
def test_every_word_is_allowed(key):
    listed = WORD_AXES[key][::-1]
    config = configured(f"classifier.{key}=[{','.join(listed)}]", "grid.replicate=2")
    assert value_of(config, key) == listed


@pytest.mark.parametrize("key", [SWITCH, *SWITCH_AXES])
def test_switches_are_on_or_off(key):
    for text, value in (("true", True), ("false", False)):
        found = value_of(configured(f"classifier.{key}={text}"), key)
        assert found == (value if key == SWITCH else (value,))
    if key != SWITCH:
        config = configured(f"classifier.{key}=[true,false]")
        assert value_of(config, key) == (True, False)


def test_names_are_one_or_several_in_the_order_given():
    for names in (("mnn",), ("likelihood", "acn"), ("correlation", "mnn", "acn", "likelihood")):
        assert value_of(configured(f"classifier.name=[{','.join(names)}]"), "name") == names
    assert value_of(configured("classifier.name=correlation"), "name") == ("correlation",)
