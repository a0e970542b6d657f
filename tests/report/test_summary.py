"""A sweep ends by printing a headline, one table of figures from its files, and paths."""

import io
import math
import re
import shlex

import numpy as np
import pytest
import xarray as xr
from made import displayed, scores
from pages import stored
from rich.cells import cell_len
from rich.console import Console
from stores import reported

from sweeps.engine.declare.errors import CallsFailedWarning, ConfigurationError
from sweeps.engine.function.sweep import sweep
from sweeps.report.frames import frame
from sweeps.report.outputs import page_file
from sweeps.report.summary import finish, print_answer, tables_of


def page(path, width=80):
    """Return the text printed at the end of a sweep."""
    console = Console(file=io.StringIO(), width=width)
    print_answer(path, tables_of(path), console)
    finish(path, tables_of(path), console)
    return console.file.getvalue()


def unwrapped(text):
    return " ".join(text.split())


def table_of(text):
    """Return the lines above the rule of the only table, and its rows as lists of words."""
    above, _, below = text.partition("────\n")
    return above.splitlines(), [line.split() for line in below.split("\n\n")[0].splitlines()]


def test_summary_has_a_headline_one_table_and_output_paths(smoke_store, monkeypatch):
    monkeypatch.chdir(smoke_store.parent)
    text = page(smoke_store)
    lines = text.splitlines()
    assert len(lines) <= 30 and max(map(cell_len, lines)) <= 80
    assert re.search(r"^Best of 8: .* identifies \d+ % \[\d+–\d+\]", unwrapped(text))
    assert "chance 50 %" in unwrapped(text)
    assert re.search(r"^Whatever the pulse width: ACN, silhouette \d+ \[\d+–\d+\]\.$", text, re.M)
    assert "Where they apply: vigilance 0.95 or 0.87." in unwrapped(text)
    assert text.count("────\n") == 1 and "0-15°" not in text
    assert {"store   sweep.zarr", "page    sweep-report.html"} <= set(lines)


def test_classifier_columns_are_sorted_best_first(smoke_store):
    _, rows = table_of(page(smoke_store))
    widths = [row for row in rows if row[0] in ("10", "30", "50")]
    assert [row[0] for row in widths] == ["10", "30", "50"]
    means = np.mean([[float(cell) for cell in row[1:]] for row in widths], axis=0)
    assert (np.diff(means) < 1).all()


@pytest.mark.parametrize("count", [12, 13, 91])
def test_many_values_are_thinned_evenly_with_both_ends(count, tmp_path):
    values = [float(value) for value in range(count)]
    path = stored(
        tmp_path / "s.zarr", {"swept": ["cnr"]}, tables__acn=displayed(scores(cnr=values))
    )
    text = page(path)
    _, rows = table_of(text)
    shown_values = [float(row[0]) for row in rows if row[0].isdigit() and len(row) == 3]
    assert len(shown_values) == min(count, 12)
    assert shown_values[0] == 0 and shown_values[-1] == count - 1
    steps = np.diff(shown_values)
    assert steps.max() - steps.min() <= 1
    assert (f"12 of {count} values of CNR, evenly spaced." in text) == (count > 12)


@pytest.mark.parametrize("count", [1, 3, 20])
def test_table_fits_for_any_number_of_classifiers(count, tmp_path):
    tables = {
        f"tables__c{k}": displayed(scores(k, cnr=[23.0, 26.0]), f"classifier number {k}")
        for k in range(count)
    }
    text = page(stored(tmp_path / "s.zarr", {"swept": ["cnr"]}, **tables), width=200)
    table = text[text.index("Ships identified") : text.index("store  ")]
    assert max(map(cell_len, table.splitlines())) <= 80
    assert "further columns" not in text
    assert ("more column" in text) == (count == 20)


def power(base, exponent):
    return float(base**exponent)


def test_swept_function_has_a_headline_and_a_table(tmp_path):
    values = {"base": [2, 3], "exponent": [1, 2, 3]}
    sweep(power, values, store=tmp_path / "p.zarr", cache=tmp_path / "cache", cluster="inline")
    text = page(tmp_path / "p.zarr")
    assert text.startswith("\nPower rises from 2 at exponent 1 to 8 at exponent 3, base 2.\n")
    heads, rows = table_of(text)
    assert "base 2  base 3" in heads[-2] and rows[:3] == [
        ["1", "2", "3"],
        ["2", "4", "9"],
        ["3", "8", "27"],
    ]


def test_zipped_settings_form_one_axis(tmp_path):
    """It has their labels, or the first setting's distinct values; a note lists the others."""
    cases = {"base": ("case", [2, 3, 4]), "exponent": ("case", [10, 5, 7])}
    for name, labels in (("labelled", {"case": ["a", "b", "c"]}), ("plain", {})):
        values = xr.Dataset(cases, labels)
        sweep(power, values, store=tmp_path / f"{name}.zarr", cache=tmp_path / "cache")
    text = unwrapped(page(tmp_path / "labelled.zarr"))
    assert text.startswith("Power is 1024 at case a and 16384 at case c.")
    assert "Case a: base 2, exponent 10; case b: base 3, exponent 5; case c: base 4, exp" in text
    text = page(tmp_path / "plain.zarr")
    assert unwrapped(text).startswith("Power rises from 1024 at base 2 to 16384 at base 4.")
    assert [row[0] for row in table_of(text)[1][:3]] == ["2", "3", "4"]
    assert "Base 2: exponent 10; base 3: exponent 5; base 4: exponent 7." in unwrapped(text)
    columns = frame(tmp_path / "plain.zarr", "power").columns
    assert {"base", "exponent", "power"} <= set(columns)  # the file has all three


def test_headline_and_notes_describe_zipped_settings(tmp_path):
    table = scores(pulse_width=[10.0, 30.0]).rename(pulse_width="pulse_width_cnr")
    labels = ["pulse_width=10,cnr=26", "pulse_width=30,cnr=32"]
    table = table.assign_coords(
        pulse_width_cnr=labels,
        pulse_width=("pulse_width_cnr", [10.0, 30.0], {"units": "ns"}),
        cnr=("pulse_width_cnr", [26.0, 32.0], {"units": "dB"}),
    )
    attributes = {"swept": ["pulse_width", "cnr"]}
    text = unwrapped(page(stored(tmp_path / "s.zarr", attributes, tables__acn=displayed(table))))
    assert "at pulse width 10 ns, not significantly better" in text and "at 30 ns" in text
    assert "Pulse width 10 ns: CNR 26 dB; pulse width 30 ns: CNR 32 dB." in text


def test_pivot_table_states_the_unit_of_its_figure(tmp_path):
    values, units = {"base": [2, 3], "exponent": [1, 2]}, {"power": {"units": "W"}}
    sweep(power, values, store=tmp_path / "p.zarr", cache=tmp_path / "cache", attrs=units)
    assert "\nPower [W]\n" in page(tmp_path / "p.zarr")


def test_headline_ignores_failed_results(tmp_path):
    def root(base, exponent):
        return math.sqrt(base - 1) ** exponent

    store = tmp_path / "r.zarr"
    with pytest.warns(CallsFailedWarning):
        sweep(root, {"base": [-3, 0, 5], "exponent": [1, 2]}, store=store, cache=tmp_path / "c")
    assert "Root is 2 at base 5, exponent 1." in page(store)


def test_partial_store_without_tables_is_reported_as_partial(tmp_path):
    partial = {"partial": "3 of 5 cells are missing"}
    path = stored(tmp_path / "s.zarr", partial, profiles=xr.Dataset({"x": ("k", [1.0])}))
    with pytest.raises(ConfigurationError, match="3 of 5 cells are missing; the sweep's command"):
        tables_of(path)


def test_classifiers_are_rows_when_nothing_is_swept(tmp_path):
    tables = {
        f"tables__{name}": displayed(scores(k, frame_count=16), name)
        for k, name in enumerate(("acn", "mnn"))
    }
    _, rows = table_of(page(stored(tmp_path / "s.zarr", {}, **tables)))
    assert {row[0] for row in rows[:2]} == {"ACN", "MNN"}
    assert int(rows[0][1]) >= int(rows[1][1])


def test_profile_error_is_stated_once_in_summary_and_page(smoke_store):
    """It is a percentage of two digits, rounded up, that 95 % of the errors do not exceed."""
    errors = xr.open_zarr(smoke_store, group="range_profile").profile_error
    html = page_file(smoke_store).read_text()
    for text in (page(smoke_store), html):
        [percent] = re.findall(r"Profiles are within (\S+) % of the exact ones", unwrapped(text))
        assert "(95 % of views)" in unwrapped(text)
        assert (errors <= float(percent) / 100).mean() >= 0.95
        assert (errors <= float(percent) / 110).mean() < 0.95


def test_suggested_commands_run(smoke_store, monkeypatch):
    monkeypatch.chdir(smoke_store.parent)
    text = page(smoke_store)
    commands = text[text.index("next    ") :].removeprefix("next    ")
    for command, *words in (shlex.split(line) for line in commands.splitlines()):
        assert command == "ncti-report" and reported(monkeypatch, *words) == 0


def test_one_table_is_printed_by_the_name_of_its_file(smoke_store, monkeypatch, capsys):
    assert reported(monkeypatch, "--table", "categories", smoke_store) == 0
    text = capsys.readouterr().out
    assert "Categories formed" in text and "Ships identified" not in text
    assert reported(monkeypatch, "--table", "speed", smoke_store) == 2
    assert "must be one of scores, categories" in capsys.readouterr().err
