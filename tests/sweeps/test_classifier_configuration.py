"""Every key of the classifiers: what it may hold, and the sentence where it may not."""

from copy import deepcopy
from dataclasses import fields, replace
from functools import lru_cache

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from sweeping import contents
from test_configuration import composed, refused

from sweeps.app import check_jobs, conf_folder, explain, replace_axes
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


def test_views_that_are_learned():
    """All by default; without ships that are unknown, at training aspects."""
    given = ("grid.ship=[duncan,horne]", "grid.aspect=[0,1.5,3]")
    assert configured(*given).learned().tolist() == [[True] * 3] * 2
    for unknown in ("duncan", "[duncan]"):
        found = configured(*given, f"classifier.unknown={unknown}").learned()
        assert found.tolist() == [[False] * 3, [True] * 3]
    for aspects in ("[3,0]", "{start: 0, stop: 3, step: 3}"):
        found = configured(*given, f"classifier.training_aspect={aspects}").learned()
        assert found.tolist() == [[True, False, True]] * 2
    both = ("classifier.unknown=horne", "classifier.training_aspect=1.5")
    assert configured(*given, *both).learned().tolist() == [[False, True, False], [False] * 3]


@pytest.mark.parametrize("value", ["noisy", "[expected,noisy]"])
def test_noisy_profiles_are_learned_of_other_replicates(value):
    """One draw leaves nothing to learn from that is not tested."""
    given = ("classifier.name=correlation", f"classifier.training={value}")
    told = sentence(*given)
    assert told.startswith("grid.replicate is 1, but must be at least 2 where classifier.training")
    assert "noisy" in told
    assert "noisy" in value_of(configured(*given, "grid.replicate=2"), "training")


# What each check is of, what it refuses, and who has to run for it to matter.
CHECKED = [
    (("classifier.training=noisy",), "grid.replicate is 1", ("correlation",)),
    (
        ("classifier.left_out=true", "grid.aspect=0"),
        "classifier.left_out has True",
        ("correlation", "likelihood"),
    ),
    (
        ("ladar.receiver=peak_pulse", "ladar.target_free_ifovs=0"),
        "ladar.receiver is 'peak_pulse'",
        ("likelihood", "fusion"),
    ),
]


@pytest.mark.parametrize("sensor", ["range", "infrared", "both"])
@pytest.mark.parametrize(("given", "said", "users"), CHECKED, ids=lambda value: str(value)[:30])
def test_settings_are_checked_for_those_who_use_them(given, said, users, sensor):
    """An experiment's settings stand when one of its classifiers is asked for alone."""
    for name in CLASSIFIERS:
        if name == "fusion" and sensor != "both":
            continue
        asked = (f"classifier.name=[{name},acn]" if name != "acn" else "classifier.name=acn",)
        if name in users and sensor != "infrared":
            assert sentence(*asked, *given, f"sensor={sensor}").startswith(said)
        else:
            assert configured(*asked, *given, f"sensor={sensor}").classifiers[0] == name


@pytest.mark.parametrize("receiver", ["first_pulse", "peak_pulse"])
@pytest.mark.parametrize("names", ["likelihood", "[acn,likelihood]"])
def test_likelihood_knows_the_moments_of_one_receiver(receiver, names):
    given = (f"classifier.name={names}", "ladar.target_free_ifovs=0")
    told = sentence(*given, f"ladar.receiver={receiver}")
    assert told.startswith(f"ladar.receiver is '{receiver}', but must be full_profile for the ")
    assert "likelihood" in told
    others = "classifier.name=[acn,mnn,correlation]"
    config = configured(*given, others, f"ladar.receiver={receiver}")
    assert config.ladar.receiver == receiver


def test_fusion_sees_every_range_with_both_sensors():
    name = "classifier.name=fusion"
    told = sentence(name)
    assert told == "sensor is 'range', but must be both for the classifier fusion"
    ranges = ("sensor=both", "grid.range=[50,100]")
    told = sentence(name, *ranges, "infrared.range=[25,100]")
    assert told.startswith("grid.range has 50, but every value must be one of 25, ")
    config = configured(name, *ranges, "infrared.range=[25,50,100]")
    assert value_of(config, "name") == ("fusion",)


@pytest.mark.parametrize("names", ["fusion", "[acn,fusion]"])
@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("infrared.phases=1", "infrared.phases is 1, but must be at least 2 for the classifier "),
        ("infrared.coverage_rule=[0.25,0.5]", "infrared.coverage_rule has 2 values, but must "),
        ("infrared.segmentation=[matched,otsu]", "infrared.segmentation has 2 values, but must "),
        ("infrared.inner_radius=[0.5,0.6,0.7]", "infrared.inner_radius has 3 values, but must "),
        ("infrared.interpolation=[nearest,bilinear]", "infrared.interpolation has 2 values, but "),
    ],
)
def test_fusion_sees_silhouettes_of_one_kind_in_several_phases(names, override, said):
    """None is taken for another: a list is refused, whatever stands first in it."""
    given = (f"classifier.name={names}", "sensor=both")
    assert sentence(*given, override).startswith(said)
    # Where it names nothing, it minds nothing.
    config = configured("classifier.name=[acn,fusion]", "sensor=infrared", override)
    assert config.classifiers == ("acn",)


@pytest.mark.parametrize(
    ("overrides", "silent"),
    [
        (("classifier.name=[acn,mnn,correlation,likelihood]",), ()),
        (("classifier.name=[acn,fusion]",), ("fusion",)),
        (("classifier.name=[acn,fusion]", "sensor=both"), ()),
        (("classifier.name=[fusion,acn]", "sensor=both", "infrared.range=25"), ("fusion",)),
        (("classifier.name=mnn", "sensor=infrared"), ("mnn",)),
        (
            ("classifier.name=[likelihood,acn,correlation,fusion]", "sensor=infrared"),
            ("likelihood", "correlation", "fusion"),
        ),
        (("classifier.name=likelihood", "sensor=infrared", "ladar=peak_pulse"), ("likelihood",)),
    ],
)
def test_who_names_nothing_is_told(overrides, silent):
    given = [item for item in overrides if not item.startswith("ladar=")]
    if len(given) < len(overrides):
        given += ["ladar.receiver=peak_pulse", "ladar.target_free_ifovs=0"]
    told = configured(*given).silent
    assert len(told) == len(silent)
    for name, words in zip(silent, told, strict=True):
        need = "sensor=both and every value" if name == "fusion" else "sensor=range or both"
        assert words.startswith(f"classifier.name has {name}, which names nothing here: it needs ")
        assert need in words


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        *((str(value), f"is {value}, but must be from 1 to 1000") for value in (0, -1, 1001)),
        (f"1{'0' * 30}", f"is 1{'0' * 30}, but must be from 1 to 1000"),
        *((value, "of type integer") for value in ("2.5", "nan", "inf", "many", "true", "[]")),
        *((value, "of type integer") for value in ("[1,2]", "{start: 1, stop: 2, step: 1}")),
        ("null", "must be given"),
    ],
)
def test_wrong_numbers_of_replicates(value, shown):
    told = sentence(f"grid.replicate={value}")
    assert told.startswith("grid.replicate is ")
    assert shown in told
    assert "\n" not in told


def test_replicates_are_numbered_from_0():
    for count in (1, 3, 1000):
        grid = configured(f"grid.replicate={count}").grid.expand()
        assert grid.replicate == tuple(range(count))


CONFIGURED = sorted(path.stem for path in conf_folder().glob("classifier/*.yaml"))


@pytest.mark.parametrize("name", CONFIGURED)
def test_files_hold_the_defaults_of_the_schema(name):
    found = OmegaConf.to_object(composed(f"classifier={name}").classifier)
    if name == "all":
        assert set(OURS) <= set(found.name)
        assert list(found.name) == [name for name in CLASSIFIERS if name in found.name]
    else:
        assert found.name == name
    assert replace(found, name=ClassifierConfig().name) == ClassifierConfig()


def test_every_classifier_has_a_file():
    assert {*CLASSIFIERS, "all"} == set(CONFIGURED)


# What an experiment asks for: classifiers, axes that it has, replicates.
EXPERIMENTS = {
    "table2": (
        ("mnn",),
        {
            "mnn.tolerance": (0.1, 0.35),
            "mnn.inputs": ("raw", "floor_removed", "standardised"),
            "mnn.annealing": (True, False),
        },
        4,
    ),
    "table4": (
        OURS,
        {"training": ("expected", "noisy"), "left_out": (False, True), "gain_sigma": (0, 1)},
        4,
    ),
    "paper": (
        (*OURS, "fusion"),
        {"gain_sigma": (0, 1), "training": ("expected",), "left_out": (False,)},
        1,
    ),
    "smoke": ((*OURS, "fusion"), {}, 1),
}


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_experiments_compose(name, cache):
    names, axes, replicates = EXPERIMENTS[name]
    config = prepare(composed(f"+experiment={name}", "grid.ship=duncan", f"cache={cache}")).config
    assert value_of(config, "name") == names
    for key, values in axes.items():
        assert value_of(config, key) == values
    assert config.grid.replicate == replicates
    # What it does not name is as by default.
    rest = {"max_passes", "nugget", "learn_in_test", "learning_rate", "mnn.max_hidden"}
    for key in rest:
        assert value_of(config, key) == value_of(configured(), key)


def test_an_experiment_takes_other_classifiers():
    config = composed(
        *replace_axes(
            ["+experiment=table2", "classifier.name=[correlation,mnn]", "grid.ship=texas"]
        )
    )
    assert value_of(prepare(config).config, "name") == ("correlation", "mnn")
    config = composed("+experiment=smoke", "classifier.name=likelihood", "grid.ship=texas")
    assert value_of(prepare(config).config, "name") == ("likelihood",)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["classifier=nearest"], ("classifier is 'nearest'", *CONFIGURED)),
        # What all of them share is no classifier.
        (["classifier=settings"], ("classifier is 'settings'", *CONFIGURED)),
        (["classifier=classifier_settings"], ("classifier is 'classifier_settings'", *CONFIGURED)),
        (["classifier.name=[acn,nearest]"], ("classifier.name has 'nearest'", *CLASSIFIERS)),
        (["classifier.mnn=5"], ("classifier.mnn is 5", "epochs")),
        (["classifier.mnn=[5]"], ("classifier.mnn is a list", "epochs")),
        (["classifier.mnn.rate=5"], ("classifier.mnn.rate", "no key", "learning_rate")),
        (["classifier.learn_in_test=maybe"], ("classifier.learn_in_test is 'maybe'", "false")),
        (["classifier=correlation", "classifier.training=noisy"], ("grid.replicate is 1", "2")),
        (["classifier=likelihood", "ladar=peak_pulse"], ("ladar.receiver is 'peak_pulse'",)),
        (["classifier=all", "grid.replicate=0"], ("grid.replicate is 0", "from 1 to 1000")),
    ],
    ids=" ".join,
)
def test_the_command_leaves_with_2_and_one_line(arguments, said, tmp_path, monkeypatch, capsys):
    given = [*arguments, "grid.ship=duncan", "store=s.zarr", "cache=cache"]
    told = refused(given, tmp_path, monkeypatch, capsys)
    for word in said:
        assert word in told


def test_classifiers_of_several_jobs():
    given = ["-m", "grid.ship=duncan", "store=${hydra:job.num}.zarr"]
    check_jobs(replace_axes([*given, "classifier=acn,mnn", "classifier.mnn.epochs=[1,2],3"]))
    with pytest.raises(ConfigurationError, match=r"classifier\.mnn\.epochs has 0"):
        check_jobs(replace_axes([*given, "classifier=acn,mnn", "classifier.mnn.epochs=[1,2],0"]))


@pytest.mark.parametrize("group", ["classifier", "scene"])
def test_a_list_of_choices_is_refused(group):
    """Hydra would lay one file over the other, and the last would run alone."""
    with pytest.raises(ConfigurationError, match=rf"^{group} is \[a,b\], but must be one choice"):
        check_jobs([f"{group}=[a,b]"])
