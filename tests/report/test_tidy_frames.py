"""Frames have each number of the store's tables at its place, with labels and units."""

import math
from functools import cache

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from made import displayed, scores
from pages import stored

from sweeps.engine.declare.display import parse_display
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.experiment import EXPERIMENT
from sweeps.report.files import csv_of
from sweeps.report.frames import PART, frame, read_frames
from sweeps.report.words import MAIN, is_missing


@cache
def group_of(path, name):
    """Return a group of a store, read by xarray alone."""
    return xr.open_zarr(path, group=name).load()


def number_at(path, part, column, row):
    """Return the number of the store that a column of a row shows."""
    array = group_of(path, part.group)[part.variables[column]]
    place = {dim: row[part.names[dim]] for dim in part.dims[column] if dim in part.names}
    absent = {dim for dim, value in place.items() if is_missing(value)}
    array = array.sel({dim: value for dim, value in place.items() if dim not in absent})
    return array.values


@pytest.mark.parametrize("name", ["smoke_store", "sisters"])
def test_every_frame_value_equals_the_stored_value(name, request):
    path = request.getfixturevalue(name)
    frames, rng = read_frames(path), np.random.default_rng(0)
    assert {"scores"} <= set(frames)
    for table in frames.values():
        for label in rng.choice(table.rows.index, min(25, len(table.rows)), replace=False):
            row = table.rows.loc[label]
            part = table.parts[int(row[PART])]
            figures = {figure.column: figure for figure in part.display.figures}
            for column in part.variables:
                value = number_at(path, part, column, row)
                described = table.columns[column]
                figure = figures[described.axis]
                expected = float(value)
                if figure.percent and (described.role != "beside" or column == "spread"):
                    expected = 100 * expected
                shown_value = row[column]
                if math.isnan(expected):
                    assert is_missing(shown_value), (table.name, column)
                else:
                    assert float(shown_value) == expected, (table.name, column)


def test_every_cell_of_a_store_is_a_row(smoke_store):
    """No cell is lost or repeated: each place on the table's axes has one row."""
    for tidied in read_frames(smoke_store).values():
        for k, part in enumerate(tidied.parts):
            rows = tidied.rows[tidied.rows[PART] == k]
            axes = [name for name in tidied.columns_of_role("axis") if rows[name].notna().any()]
            assert not rows.duplicated(axes).any(), tidied.name
            table = xr.open_zarr(smoke_store, group=part.group)
            variables = {part.variables[name] for name in part.variables}
            sizes = table[sorted(variables)].sizes
            assert len(rows) == math.prod(sizes.values()), tidied.name


def test_csv_files_equal_their_frames(smoke_store, tmp_path):
    for table in read_frames(smoke_store).values():
        (tmp_path / "t.csv").write_bytes(csv_of(table))
        copy = pd.read_csv(tmp_path / "t.csv", dtype={"aspect_bin_deg": str}, na_values=[""])
        assert list(copy) == [name for name in table.rows if name != PART]
        for name in copy:
            for value, read in zip(table.rows[name], copy[name], strict=True):
                digits = table.columns[name].digits
                if is_missing(value):
                    assert is_missing(read)
                elif digits is not None:
                    assert read == round(value, digits)
                else:
                    assert value == read or float(value) == float(read), name


def test_columns_have_the_labels_and_units_of_outputs_and_settings(smoke_store):
    rows = frame(smoke_store, "scores")
    columns = rows.attrs["columns"]
    assert columns["range_km"] == {"label": "slant range", "unit": "km"}
    assert columns["pulse_width_ns"]["unit"] == "ns" and columns["percent_correct"]["unit"] == "%"
    assert set(columns) == set(rows) and PART not in rows
    of_fusion = rows[rows.classifier == "fusion"]
    assert set(of_fusion.channel) == {"range", "infrared", "both"}


def test_undeclared_tables_need_no_display(tmp_path):
    table = xr.Dataset(
        {
            "height": (("ripeness", "weather"), [[1.0, 2.0], [4.0, np.nan]]),
            "height_ci_low": (("ripeness", "weather"), np.zeros((2, 2))),
            "height_ci_high": (("ripeness", "weather"), np.full((2, 2), 9.0)),
            "image": (("row", "column"), np.zeros((2, 2))),
        },
        {"ripeness": [1, 2], "weather": ["sun", "=rain"]},
        {"title": "Apples"},
    )
    table.height.attrs = {"units": "m", "long_name": "height of a tree"}
    tidied = read_frames(stored(tmp_path / "s.zarr", tables__apples=table))["apples"]
    assert tidied.title == "Apples" and tidied.figures == ["height"]
    assert tidied.columns_of_role("low", "height") == ["ci_low"] and "image" not in tidied.rows
    assert len(tidied.rows) == 4 and tidied.columns["height"].unit == "m"
    assert b"'=rain" in csv_of(tidied)


def test_unknown_table_or_store_is_refused(tmp_path):
    path = stored(tmp_path / "s.zarr", tables__acn=displayed(scores(frame_count=[4])))
    with pytest.raises(ConfigurationError, match=r"'speed', but must be one of scores"):
        frame(path, "speed")
    with pytest.raises(ConfigurationError, match=r"which does not exist$"):
        frame(tmp_path / "absent.zarr", "scores")


@pytest.mark.parametrize("attribute", [{"figures": [{"beside": {}}]}, {}])
def test_tables_of_another_version_are_refused(attribute):
    with pytest.raises(ConfigurationError, match="another version wrote its tables"):
        parse_display({"rows": [], "notes": [], **attribute})


def test_preferred_values_are_declared_defaults():
    defaults = {}
    for setting in EXPERIMENT.declared:
        default = setting.default
        defaults.setdefault(setting.name, []).extend(
            default if type(default) is list else [default]
        )
    other = {"aspect", "kind"}  # they have another meaning in a table
    for name in MAIN.keys() & defaults.keys() - other:
        assert MAIN[name] in defaults[name], name
