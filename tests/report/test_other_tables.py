"""Tables of stages that nobody foresaw are printed and written, by the names that they have."""

import io
import re

import numpy as np
import pytest
import xarray as xr
from made import formed, scores
from rich.console import Console
from stores import contents, printed, rows_of, signed

from sweeps.report.others import MOST, other_rows, print_other
from sweeps.report.places import tables_folder

BINS = ["0-27", "overall"]
AXES = {"ripeness": [10.0, 20.0, 30.0], "colour": ["green", "red"], "aspect_bin": BINS}


def toy(seed=0, **attributes):
    """Scores of a toy classifier: a figure of every cell, one of fewer axes, and a word."""
    rng = np.random.default_rng(seed)
    share = rng.uniform(0.2, 0.8, (3, 2, 2))
    data = {name: ([*AXES], share + k) for k, name in enumerate(("accuracy", "ci_low", "ci_high"))}
    data["height"] = ("ripeness", [1.5, np.nan, 2.5], {"units": "m", "long_name": "how tall"})
    data["best"] = (("ripeness", "replicate"), np.array([["a", "b"]] * 3, dtype=object))
    coords = AXES | {"replicate": [0, 1], "weight": 7.0}
    table = xr.Dataset(data, coords, attributes)
    table["ripeness"].attrs = {"units": "%", "long_name": "how ripe it is"}
    table["accuracy"].attrs = {"units": "1", "long_name": "share of pears named right"}
    return table


def stored(path, **tables):
    for name, table in tables.items():
        table.to_zarr(path, group=f"tables/{name}", mode="a", consolidated=False)
    return signed(path)


def test_every_cell_is_a_row_with_its_place_and_its_figures():
    table = toy()
    rows = other_rows(table)
    assert len(rows) == 3 * 2 * 2 * 2
    assert len({(*row.values(),)[:5] for row in rows}) == len(rows)
    for row in rows:
        at = {"ripeness": row["ripeness_percent"], "colour": row["colour"]}
        at |= {"aspect_bin": row["aspect_bin_deg"], "replicate": row["replicate"]}
        for name in ("accuracy", "ci_low", "ci_high", "best"):
            here = {dim: value for dim, value in at.items() if dim in table[name].dims}
            assert row[name] == table[name].sel(here).item()
        tall = table.height.sel(ripeness=at["ripeness"]).item()
        assert row["height_m"] == (None if np.isnan(tall) else tall)
        assert row["weight"] == 7.0


def test_a_table_of_any_stage_is_printed_and_in_a_file_of_its_name(tmp_path):
    path = stored(tmp_path / "s.zarr", toy=toy(), more=toy(1, title="Pears by weight"))
    text = printed(path)
    rows = rows_of(path, "toy")
    assert [row["accuracy"] for row in rows] == [str(row["accuracy"]) for row in other_rows(toy())]
    assert set(contents(tables_folder(path))) == {"toy.csv", "more.csv"}
    assert "Toy" in text and "Pears by weight" in text
    for heading in ("ripeness [%]", "colour", "height [m]", "ci low", "best"):
        assert heading in text
    assert "weight" not in text.replace("by weight", "")  # of one value: the file has it
    assert "accuracy: share of pears named right; height: how tall." in text
    assert "ripeness: how ripe it is" in text
    assert f"{other_rows(toy(1))[0]['accuracy']:.4g}" in text


def test_a_table_that_is_called_like_a_file_of_another_takes_nobodys_place(tmp_path):
    acn = scores(
        prefixes=("", "training_"),
        pulse_width=[30.0],
        range=[100.0],
        vigilance=[0.95],
        frame_count=[4],
        target_free_ifovs=4000,
    )
    acn = formed(acn, over=("pulse_width", "vigilance"))
    path = stored(tmp_path / "s.zarr", acn=acn, accuracy=toy())
    printed(path)
    names = {"accuracy.csv", "accuracy_table.csv", "categories.csv"}
    assert set(contents(tables_folder(path))) == names
    assert "percent_correct" in rows_of(path, "accuracy")[0]
    assert "ripeness_percent" in rows_of(path, "accuracy_table")[0]


def test_a_classifier_of_range_profiles_stands_beside_the_others(tmp_path):
    axes = {"pulse_width": [30.0], "range": [100.0], "frame_count": [4], "target_free_ifovs": 4000}
    path = stored(tmp_path / "s.zarr", oracle=scores(**axes, patience=[1, 2]))
    text = printed(path)
    rows = rows_of(path, "classifiers")
    assert {(row["classifier"], row["patience"]) for row in rows} == {
        ("oracle", "1"),
        ("oracle", "2"),
    }
    assert "oracle" in text and "patience 1" in text
    assert set(contents(tables_folder(path))) == {"classifiers.csv"}


@pytest.mark.parametrize("size", [1, MOST, MOST + 5])
def test_long_tables_end_on_the_screen_and_say_so(size):
    table = xr.Dataset({"y": ("x", np.arange(size) / 7)}, {"x": np.arange(size) * 10})
    console = Console(file=io.StringIO(), width=100)
    print_other("T", other_rows(table), console)
    text = console.file.getvalue()
    lines = re.findall(r"^(?:\d+ +)?[\d.e-]+$", text, re.M)
    assert len(lines) == min(size, MOST)
    assert ("5 more rows" in console.file.getvalue()) == (size > MOST)


def test_nothing_to_tell_is_told_of_nothing(tmp_path):
    """A group of images alone has no table, and does not hide the others."""
    images = xr.Dataset({"image": (("row", "column"), np.zeros((2, 2)))})
    path = stored(tmp_path / "s.zarr", pictures=images, toy=toy())
    printed(path)
    assert set(contents(tables_folder(path))) == {"toy.csv"}
