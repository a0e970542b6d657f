"""Every setting allows its default, refuses wrong values in a sentence, and is in the docs."""

import re
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.stage import bind
from sweeps.experiment import EXPERIMENT

DOCS = Path(__file__).resolve().parents[2] / "docs"
DECLARED = EXPERIMENT.declared
# Settings without effect on results, and those that choose stages and tables instead.
NOT_READ = {
    *("benchmark.classifier", "sensor", "dataset.sensor", "classifier.test_vigilance"),
    "classifier.generated",  # its ships come into three other settings
}

each = partial(pytest.mark.parametrize, "setting", ids=lambda setting: setting.key)


@each(DECLARED)
def test_defaults_are_valid_and_round_trip(setting):
    if setting.fallback is not None:
        assert setting.fallback in DECLARED
        return
    values = setting.values(setting.default)
    assert values
    assert setting.values(setting.kind.as_input(values)) == values


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(["start", "stop", "step", "x"]), inner, max_size=4)
    ),
    max_leaves=6,
)


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(DECLARED), ANYTHING)
def test_any_input_is_parsed_or_refused_in_one_line(setting, value):
    try:
        values = setting.values(value)
    except ConfigurationError as error:
        assert str(error).startswith(setting.key)
        assert "must" in str(error) or "not a key" in str(error)
        assert "\n" not in str(error)
    else:
        assert len(set(values)) == len(values) >= 1
        assert setting.values(setting.kind.as_input(values)) == values


def test_every_setting_affecting_results_is_read_by_a_stage():
    bound = bind(EXPERIMENT).values()
    read_keys = {key for stage in bound for key in (*stage.needs, *stage.gather)}
    unread = {setting.key for setting in DECLARED if setting.affects_results} - read_keys
    assert unread == NOT_READ


# Its documentation --------------------------------------------------------------------------


def test_settings_table_in_the_docs_is_current(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "_extensions"))
    from settings_table import TABLE, table

    assert TABLE.read_text(encoding="utf-8") == table(), (
        "not current: python docs/_extensions/settings_table.py"
    )


def test_stage_inputs_table_in_the_docs_is_current(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "_extensions"))
    from stage_inputs import TABLE, rows, table

    assert TABLE.read_text(encoding="utf-8") == table(), (
        "not current: python docs/_extensions/stage_inputs.py"
    )
    units = {name: unit for names, _, unit, _ in rows() for name in re.findall(r"\w+", names)}
    expected = {"aspect": "degree", "range": "m", "pulse_width": "s", "depression": "degree"}
    assert expected.items() <= units.items()
    assert {"image", "mesh", "mesh_source", "rng"} <= units.keys()
