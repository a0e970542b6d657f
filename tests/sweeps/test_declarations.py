"""Every setting as it is declared: its default, its bounds, its axis, its place in the docs."""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import hydra
import pytest
from commands import COMMAND, chosen, ran
from declared_values import ends, one, override, two, wrong
from hypothesis import given, settings
from hypothesis import strategies as st

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.front import composing, read_configuration, replaceable
from sweeps.engine.kinds import Count, Draws, Number, SetOf
from sweeps.engine.plan import axes_of
from sweeps.engine.provenance import written
from sweeps.engine.settings import Choices, read_choices, settings_table
from sweeps.engine.stage import bind, nothing_to_check
from sweeps.experiment import EXPERIMENT

PAGE = Path(__file__).resolve().parents[2] / "docs" / "settings.md"
DECLARED = EXPERIMENT.declared
FREE = [setting for setting in DECLARED if not setting.fixed]
NUMBERS = [setting for setting in FREE if isinstance(setting.kind, Number | Count)]
# What no result depends on, and what chooses stages and tables instead of entering them.
NOT_READ = {"sensor", "classifier.test_vigilance"}

each = partial(pytest.mark.parametrize, "setting", ids=lambda setting: setting.key)


def refused(setting, value):
    with pytest.raises(ConfigurationError) as caught:
        setting.values(value)
    sentence = str(caught.value)
    assert sentence.startswith(setting.key), sentence
    assert "\n" not in sentence
    return sentence


def test_keys_and_dimensions_are_told_apart():
    assert len({setting.key for setting in DECLARED}) == len(DECLARED) > 100
    # A dimension of two settings is named by their whole keys, where both are in one group.
    assert "mnn_learning_rate" in {setting.name for setting in DECLARED}


@each(DECLARED)
def test_the_default_is_allowed_and_written_as_it_is_read(setting):
    if setting.default is None and setting.fallback is not None:
        assert setting.fallback in DECLARED
        return
    values = setting.values(setting.default)
    assert values
    assert setting.values(written(setting, values)) == values


@each(DECLARED)
def test_both_ends_and_every_word_are_allowed(setting):
    for value in ends(setting.kind):
        found = setting.values(value)
        assert setting.values(written(setting, found)) == found


@each(DECLARED)
def test_what_it_may_not_be_is_refused_by_key_value_and_what_is_allowed(setting):
    assert len(wrong(setting)) >= 2
    for value, shown, allowed in wrong(setting):
        sentence = refused(setting, value)
        assert shown in sentence, sentence
        assert allowed in sentence, sentence


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(["start", "stop", "step", "x"]), inner, max_size=4)
    ),
    max_leaves=6,
)


@settings(max_examples=1500, deadline=None)
@given(st.sampled_from(DECLARED), ANYTHING)
def test_anything_is_values_or_a_sentence(setting, value):
    try:
        values = setting.values(value)
    except ConfigurationError as error:
        assert str(error).startswith(setting.key)
        assert "must" in str(error) or "not a key" in str(error)
        assert "\n" not in str(error)
    else:
        assert len(set(values)) == len(values) >= 1
        assert setting.values(written(setting, values)) == values


@each(FREE)
def test_two_values_are_an_axis(setting):
    several = {"irar.errors": {"pointing": [1, 2]}}.get(setting.key)
    given = 3 if isinstance(setting.kind, Draws) else several or list(two(setting.kind))[::-1]
    axis = next(
        axis
        for axis in axes_of(DECLARED, read_choices(DECLARED, {setting.key: given}))
        if axis.settings == (setting,)
    )
    assert axis.several and axis.name == setting.name
    values = [value for (value,) in axis.points]
    assert values == sorted(values, key=lambda value: values[0] if value == "none" else value)


@each([setting for setting in DECLARED if setting.fixed])
def test_what_takes_one_value_says_why(setting):
    if isinstance(setting.kind, SetOf):  # a list is one value
        assert len(setting.values(list(two(setting.kind)))) == 1
    elif setting.key != "grid.zip":
        sentence = refused(setting, list(two(setting.kind)))
        assert "has 2 values, but must have one" in sentence
        assert setting.fixed in sentence


def test_every_setting_is_read_by_a_stage_or_says_where_to_run():
    bound = bind(EXPERIMENT).values()
    read = {key for stage in bound for key in (*stage.needs, *stage.gather)}
    unread = {setting.key for setting in DECLARED if setting.identity} - read
    assert unread == NOT_READ


# What is said of it -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rows():
    """Rows of the table of settings by key."""
    lines = settings_table(EXPERIMENT.declared).splitlines()[2:]
    found = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
    return {row[0].strip("`"): row for row in found}


@each(DECLARED)
def test_it_says_what_it_is_and_in_which_unit(setting, rows):
    assert setting.label and not setting.label.endswith(".")
    assert re.fullmatch(r"1|[A-Za-z]+-?\d*( [A-Za-z]+-?\d*)*", setting.unit)
    _, default, unit, allowed, what = rows[setting.key]
    assert default != "" and unit == ("" if setting.unit == "1" else setting.unit)
    null = "null or " if setting.fallback else ""
    assert allowed.startswith(f"{null}{setting.kind.allowed}") and setting.fixed in allowed
    assert what.startswith(setting.label) and setting.help in what


def test_the_table_is_printed_and_in_the_docs(capsys):
    assert ran("--settings") == 0
    table = settings_table(EXPERIMENT.declared)
    assert capsys.readouterr().out == f"{table}\n"
    assert PAGE.read_text(encoding="utf-8") == f"# Settings\n\n{table}\n", (
        "not current: (echo '# Settings'; echo; ncti-sweep --settings) > docs/settings.md"
    )


# On the command line ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def composed():
    """Function: choices that Hydra makes of values of many settings at once, unchecked."""
    unchecked = replace(EXPERIMENT, check=nothing_to_check)

    def compose(values) -> Choices:
        overrides = [override(key, value) for key, value in values.items()]
        with composing(EXPERIMENT):
            made = hydra.compose("config", overrides=replaceable(EXPERIMENT, overrides))
        return read_configuration(unchecked, made)

    return compose


def test_the_configuration_is_that_of_the_declarations(composed):
    assert composed({}) == read_choices(DECLARED, {})
    assert chosen("grid.ship=duncan")[EXPERIMENT.declared[1]] == ("duncan",)


def test_one_value_of_each(composed):
    values = {setting.key: one(setting) for setting in DECLARED if setting.key != "grid.zip"}
    found = composed(values)
    for setting in DECLARED:
        if setting.key in values:
            assert found[setting] == setting.values(values[setting.key]), setting.key


def test_a_list_of_each(composed):
    listed = [one for one in FREE if not isinstance(one.kind, Draws) and one.key != "irar.errors"]
    found = composed({setting.key: two(setting.kind) for setting in listed})
    for setting in listed:
        assert found[setting] == setting.values(two(setting.kind)), setting.key
        assert len(found[setting]) == 2
    errors = composed({"irar.errors.pointing": [2, 1]}).values["irar.errors"]
    assert errors == (("none", 0.0), ("pointing", 1.0), ("pointing", 2.0))


def test_start_stop_and_step_of_each_number(composed):
    steps = {}
    for setting in NUMBERS:
        low, high = two(setting.kind)
        steps[setting.key] = {"start": low, "stop": high, "step": high - low}
    found = composed(steps)
    for setting in NUMBERS:
        assert found[setting] == pytest.approx(two(setting.kind), rel=1e-12, abs=1e-12), setting.key


@pytest.mark.parametrize("setting", [one for one in NUMBERS if isinstance(one.default, dict)])
def test_a_part_of_a_default_in_steps_is_changed_alone(setting, composed):
    values = composed({f"{setting.key}.step": setting.default["stop"] / 2})[setting]
    assert values == (0, setting.default["stop"] / 2, setting.default["stop"])


def test_a_wrong_command_ends_with_one_sentence_and_leaves_nothing(folder, capsys):
    for arguments in (
        ["infrared.nedt=nan", "store=s.zarr", "cache=cache"],
        ["-m", "grid.aspect=[0],[400]", "grid.ship=duncan"],
        ["grid.ship=duncan", "gird.ship=texas"],
        ["grid.range=[25"],
    ):
        assert ran(*arguments) == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        first, sentence = printed.err.splitlines()
        assert first == f"{COMMAND.name}: reading the configuration"
        assert sentence.startswith(f"{COMMAND.name}: ") and "Traceback" not in sentence
        assert list(folder.iterdir()) == []
