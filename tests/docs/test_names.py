"""The glossary's table of names has the code's parameters, settings, dimensions and units."""

import inspect
import re

import pytest
from documentation import ROOT

import ncti
from ncti.checks import UNITS
from sweeps.experiment import EXPERIMENT

TABLE = (
    (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").split("## Names of quantities")[1]
)
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in TABLE.splitlines()
    if line.startswith("|")
][2:]
DOORS = (ncti.simulate.range_profile, ncti.simulate.infrared_image, ncti.dataset)
FUNCTIONS = [
    thing
    for package in (ncti.ladar, ncti.infrared, ncti.render, ncti.classify)
    for thing in (getattr(package, name) for name in package.__all__)
    if callable(thing) and not (isinstance(thing, type) and issubclass(thing, Exception))
]
SETTINGS = {setting.key: setting for setting in EXPERIMENT.declared}


def named(cell):
    """Return the names of a cell, each with the unit behind it, which is empty without one."""
    return re.findall(r"`([\w.]+)`(?: \[(\w+)\])?", cell)


def parameters(functions):
    return {name for function in functions for name in inspect.signature(function).parameters}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_documented_names_and_units_match_the_code(row):
    _, door, other, command, store = map(named, row)
    assert {name for name, _ in door} <= parameters(DOORS)
    assert other and {name for name, _ in other} <= parameters(FUNCTIONS)
    for name, unit in (*door, *other):
        assert not unit or UNITS.get(name, unit) == unit
    [(key, unit)], [(dimension, in_store)] = command, store
    setting = SETTINGS[key]
    assert str(setting.unit) == (unit or "1") and unit == in_store
    assert setting.name == dimension


def test_entry_points_share_keyword_names():
    """All functions ask for frames, ranges and pulses by the same keywords."""
    asked = {name for row in ROWS for name, _ in named(row[1])}
    others = {name for row in ROWS for name, _ in named(row[2])} - asked
    assert others & parameters(DOORS) == set()
