"""Data sets become rows whatever their axes are: nobody has to foresee one."""

import io
import re

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from made import formed, scores, with_units
from rich.console import Console

from sweeps.report.axes import Axis, nominal, which
from sweeps.report.rows import BIN, cells, of_one, several, together
from sweeps.report.screen import explain, percent_text, unforeseen
from sweeps.report.silhouettes import (
    fusion_rows,
    print_fusion,
    print_silhouette_accuracy,
    silhouette_accuracy_rows,
    silhouette_category_rows,
)
from sweeps.report.tables import (
    accuracy_rows,
    category_rows,
    classifier_rows,
    print_accuracy,
    print_categories,
    print_classifiers,
)

PROFILES = {
    "pulse_width": [10.0, 30.0],
    "range": [100.0],
    "target_free_ifovs": 4000,
    "vigilance": [0.9, 0.95],
    "frame_count": [4, 16],
}
CNR = {"cnr": [10.0, 20.0]}


def shown(write, rows):
    console = Console(file=io.StringIO(), width=300)
    write(rows, console)
    explain(unforeseen(rows), console)
    return " ".join(console.file.getvalue().split())


@settings(deadline=None)
@given(
    st.dictionaries(
        st.sampled_from(["zeta", "cnr", "range", "frame_count", "ship", "aspect_bin", "a"]),
        st.integers(1, 3),
        min_size=1,
        max_size=4,
    ),
    st.integers(0, 2**32 - 1),
)
def test_every_cell_is_a_row_with_its_place(sizes, seed):
    """Found again in the data set by what the row says of its axes."""
    coords = {name: [float(10 * k) for k in range(size)] for name, size in sizes.items()}
    values = np.random.default_rng(seed).random(tuple(sizes.values()))
    dataset = with_units(xr.Dataset({"x": (tuple(sizes), values)}, coords))
    rows = list(cells(dataset))
    assert len(rows) == values.size
    for place, cell in rows:
        at = {axis.name: value for axis, value in place.items()}
        assert cell["x"] == dataset.x.sel(at).item()
    assert len({tuple(place.values()) for place, _ in rows}) == values.size


@pytest.mark.parametrize(
    ("units", "column", "heading"),
    [
        ("km", "range_km", "range [km]"),
        ("degree", "range_deg", "range [deg]"),
        ("m s-1", "range_m_s", "range [m/s]"),
        ("dB km-1", "range_db_per_km", "range [dB/km]"),
        ("urad", "range_urad", "range [µrad]"),
        ("1", "range", "range"),
        ("K", "range_k", "range [K]"),
    ],
)
def test_names_of_columns_have_the_store_s_units(units, column, heading):
    axis = Axis(xr.DataArray(1.0, name="range", attrs={"units": units}))
    assert axis == column
    assert axis.heading == heading


def test_nan_is_no_value_and_draws_are_no_axes():
    dataset = xr.Dataset({"x": 1.0}, {"pointing": np.nan, "replicate": 0, "chain": "exact"})
    ((place, _),) = cells(dataset)
    assert place == {"chain": "exact", "pointing": None}


@pytest.mark.parametrize("unforeseen", [CNR, {"extinction": [0.1, 0.2]}, {"pixel": [0.5, 0.25]}])
def test_an_unforeseen_axis_is_a_column_and_a_word_of_the_title(unforeseen):
    ((name, values),) = unforeseen.items()
    tables = scores(prefixes=("", "training_"), **PROFILES, **unforeseen)
    rows = accuracy_rows(tables)
    ((column, axis),) = ((str(key), key) for key in rows[0] if key.startswith(name))
    assert {row[column] for row in rows} == set(values)
    for row in rows[-12:]:
        at = {name: row[column], "pulse_width": row["pulse_width_ns"], "aspect_bin": row[BIN]}
        at |= {"vigilance": row["vigilance"], "frame_count": row["frame_count"]}
        figure = 100 * tables.accuracy.sel(at).item()
        assert row["percent_correct"] == pytest.approx(figure, abs=0.0501)
    text = shown(print_accuracy, rows)
    for value in values:
        title = "Percent correct, ACN (100 km, 4000 target-free IFOVs, 30 ns, vigilance 0.95, "
        assert title + f"{name} {value:g} {axis.unit}".strip() + ")" in text
    # No figure is shown twice or lost: titles have 2 pulse widths each, at both values.
    assert text.count("Percent correct, ACN") == 4
    for row in (row for row in rows if row["vigilance"] == 0.95):
        assert percent_text(row) in text
    if axis.long_name:
        assert f"{name}: {axis.long_name}." in text


def test_an_axis_of_tests_alone_leaves_the_training_in_every_table():
    tables = scores(prefixes=("", "training_"), **PROFILES, **CNR)
    own = [name for name in tables if str(name).startswith("training_")]
    tables = tables.assign({name: tables[name].isel(cnr=0, drop=True) for name in own})
    rows = accuracy_rows(tables)
    assert {row["cnr_db"] for row in rows} == {None, 10.0, 20.0}
    text = shown(print_accuracy, rows)
    assert text.count("Percent correct, ACN") == text.count(" training ") == 4


def test_a_joint_axis_has_a_column_for_each_of_its_coordinates():
    joint = {"pair": {"pulse_width": [10.0, 30.0], "cnr": [5.0, 20.0]}}
    rest = {name: values for name, values in PROFILES.items() if name != "pulse_width"}
    for number in ({}, {"pair": ("pair", [0, 1])}):
        tables = formed(scores(**rest, **joint).assign_coords(number), over=("pair", "vigilance"))
        rows = category_rows(tables)
        assert {(row["pulse_width_ns"], row["cnr_db"]) for row in rows} == {(10, 5), (30, 20)}
        assert ("pair" in rows[0]) == bool(number)
        text = shown(print_categories, rows)
        for pulse_width, cnr in ((10, 5), (30, 20)):
            assert re.search(rf"4000 target-free IFOVs, cnr {cnr} dB\).*?─ {pulse_width} ", text)
        assert "pair" not in text


def test_an_unforeseen_axis_in_every_other_table():
    given = PROFILES | CNR
    tables = {"acn": scores(prefixes=("", "training_"), **given)}
    of_bound = {name: value for name, value in given.items() if name != "vigilance"}
    tables["likelihood"] = scores(1, gain_sigma=[0.0, 1.0], left_out=False, **of_bound)
    rows = classifier_rows(tables)
    text = shown(print_classifiers, rows)
    assert text.count("Percent correct by classifier") == 2 * 2
    assert "30 ns, cnr 20 dB)" in text
    for row in (row for row in rows if row["classifier"] == "acn" and row["frame_count"]):
        at = {"cnr": row["cnr_db"], "pulse_width": row["pulse_width_ns"], "gain_sigma": 1.0}
        at |= {"frame_count": row["frame_count"], "aspect_bin": row[BIN]}
        bound = round(100 * tables["likelihood"].accuracy.sel(at).item(), 1)
        assert row["points_below_bound"] == pytest.approx(bound - row["percent_correct"], abs=1e-6)
    both = {"channel": ["both", "infrared", "range"], "super_resolution": ["none"]}
    both |= {"infrared_frame_count": [16], "gain_sigma": 1.0}
    fused = fusion_rows(scores(**of_bound, **both))
    text = shown(print_fusion, fused)
    assert text.count("Percent correct by maximum likelihood") == 4
    assert re.search(r" range profile .* silhouette \d.* both \d", text)
    seen = {"vigilance": [0.87], "range": [50.0], "super_resolution": ["none"], "frame_count": [16]}
    seen = scores(prefixes=("", "training_"), spread=True, **seen, **CNR)
    text = shown(print_silhouette_accuracy, silhouette_accuracy_rows(seen))
    assert "(16 frames, vigilance 0.87, cnr 10 dB)" in text
    counted = silhouette_category_rows(formed(seen, over=("cnr", "vigilance")))
    assert [row["cnr_db"] for row in counted] == [10.0, 20.0]


def test_rows_of_several_kinds_have_the_same_columns():
    first, second = (next(cells(made))[0] for made in (scores(cnr=1.0), scores(range=1.0)))
    rows = together([{"kind": "a"} | first | {"n": 1}], [{"kind": "b"} | second | {"m": 2}])
    assert [list(row) for row in rows] == [["kind", "range_km", "cnr_db", BIN, "n", "m"]] * 2
    assert [row["cnr_db"] for row in rows] == [1.0, None]
    assert [row["n"] for row in rows] == [1, None]


def test_one_of_several_is_the_nominal_one_or_the_first():
    tables = scores(label_rule=["first", "majority"], cnr=[5.0, 20.0], mast_gain=[0.0, 1.0, 3.0])
    one = nominal(tables, keep=("aspect_bin",))
    assert (one.label_rule, one.cnr, one.mast_gain) == ("majority", 5.0, 1.0)
    assert nominal(tables, mast_gain=3.0).mast_gain == 3.0
    told = which(one, tables)
    assert told == ", named by its majority members, cnr 5 dB, mast gain 1"
    rows = of_one([place for place, _ in cells(tables)])
    assert {row["label_rule"] for row in rows} == {"majority"}
    assert several(rows, but=(BIN,)) == ["cnr_db", "mast_gain"]


def test_errors_of_flights_are_told_by_parameter_and_value():
    joint = {"error": {"error_parameter": ["none", "ship_heading"], "error_value": [0.0, 5.0]}}
    tables = scores(**joint).assign_coords(error=[0, 1])
    assert which(tables.isel(error=0), tables) == ", no error"
    assert which(tables.isel(error=1), tables) == ", ship heading wrong by 5"
