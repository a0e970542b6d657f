"""The page at the end of a sweep: short, fair to the source, and of figures that the files have."""

import io
import re
import shlex
from pathlib import Path

import pytest
from commands import chosen, prepared
from made import formed, scores
from rich.cells import cell_len
from rich.console import Console
from stores import contents, printed, reported, rows_of

from sweeps.report.headline import SCORE, at_one_setting, is_fair, wanted
from sweeps.report.parts import parts_of
from sweeps.report.rows import BIN, page_file, score_rows, tables_folder
from sweeps.report.summary import continued, extended, summarize, swept
from sweeps.stages.infrared import Infrared
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import Grid, Scene

GIVEN = ["+experiment=smoke", "store=sweep.zarr", "cache=cache"]
AXES = {"grid.ship": 2, "grid.aspect": 7, "grid.pulse_width": 3}
PLACES = ("store   ", "tables  ", "report  ")


def page(path, width=80, given=GIVEN, axes=AXES):
    """What is printed at the end of a sweep."""
    console = Console(file=io.StringIO(), width=width)
    summarize(path, chosen("+experiment=smoke"), axes, console, given=given)
    return console.file.getvalue()


def test_it_is_one_page_with_each_classifier_once(smoke_store, monkeypatch):
    monkeypatch.chdir(smoke_store.parent)
    text = page(smoke_store)
    lines = text.splitlines()
    assert len(lines) <= 32 and max(map(cell_len, lines)) <= 80
    assert "Swept (numbers of values): grid.ship (2), grid.aspect (7), grid.pulse_width (3)." in (
        " ".join(text.split())
    )
    names = [line.strip().split("  ")[0] for line in lines]
    expected = ["range profiles", "ACN", "MNN, ship + aspects", "MNN, ship alone", "correlation"]
    expected += ["max. likelihood", "silhouettes", "ACN", "similarity", "both sensors"]
    begin = names.index("range profiles")
    assert names[begin : begin + 11] == [*expected, "max. likelihood"]
    assert "range profiles: 100 km, 30 ns, vigilance 0.95, 16 frames, gain" in " ".join(
        text.split()
    )
    assert "store   sweep.zarr" in lines and "tables  sweep-tables (10 CSV files)" in lines


def test_its_figures_are_those_of_the_files(smoke_store):
    rows = rows_of(smoke_store, "classifiers")
    line = next(line for line in page(smoke_store).splitlines() if "correlation" in line)
    at = {"classifier": "correlation", "pulse_width_ns": "30.0", "frame_count": "16"}
    figures = [
        "{:.0f} [{:.0f}-{:.0f}]".format(*(float(row[name]) for name in SCORE))
        for row in rows
        if at.items() <= row.items() and row["left_out"] in ("", "False")
    ]
    assert re.split(r" {2,}", line.strip())[1:] == figures and len(figures) == 4


def test_the_next_commands_would_run(smoke_store, tmp_path, monkeypatch):
    monkeypatch.chdir(smoke_store.parent)
    text = page(smoke_store)
    commands = text[text.index("next    ") :].removeprefix("next    ").replace("\\\n", "")
    *reports, sweep = (shlex.split(line) for line in commands.splitlines())
    assert [words[0] for words in (*reports, sweep)] == ["ncti-report"] * 2 + ["ncti-sweep"]
    for words in reports:
        assert reported(monkeypatch, *words[1:]) == 0
    ((choices, store),) = prepared(*sweep[1:])
    assert choices[Grid.pulse_width] == (10, 30, 40, 50) and Path(store).name == "sweep.zarr"
    # A multirun is not varied, nor what has no command line.
    for given in ([], ["-m", "seed=1,2"]):
        assert "ncti-sweep" not in page(smoke_store, given=given)


@pytest.mark.parametrize(
    ("override", "values"),
    [
        ("grid.vigilance=[0.9,0.99]", [0.9, 0.945, 0.99]),
        ("grid.frame_count=[4,16]", [4, 10, 16]),
        ("grid.frame_count=[4,5]", None),
        ("grid.pulse_width=30", None),
        ("grid.pulse_width={start:10,stop:50,step:1}", None),
    ],
)
def test_one_more_value_is_one_that_is_allowed(override, values):
    key = override.partition("=")[0].partition(".")[2]
    setting = getattr(Grid, key)
    assert extended(setting, chosen("grid.ship=duncan", override)) == values


def test_long_commands_go_on_below():
    words = [f"word{k}" for k in range(30)]
    lines = continued(words, 40).split("\n")
    assert max(map(len, lines)) <= 40 and all(line.endswith(" \\") for line in lines[:-1])
    assert shlex.split(continued(words, 40).replace("\\\n", "")) == words


def test_a_sweep_of_one_value_each_says_so():
    assert swept({}) == "Swept: nothing; every setting has one value."


@pytest.mark.parametrize("name", ["[red]x.zarr", "a b\x1b[31mc.zarr", "[/].zarr"])
def test_names_of_paths_are_shown_as_they_are(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    axes = {"pulse_width": [30.0], "range": [100.0], "vigilance": [0.95], "frame_count": [4]}
    tables = scores(prefixes=("", "training_"), **axes, target_free_ifovs=4000)
    path = tmp_path / name
    made = formed(tables, over=("pulse_width", "vigilance"))
    made.to_zarr(path, group="tables/acn", mode="w", consolidated=False)
    page_file(path).write_text("")
    console = Console(file=io.StringIO(), width=100, force_terminal=True)
    summarize(path, chosen(), {}, console, given=["grid.ship=[duncan]"])
    text = console.file.getvalue()
    shown = name.replace("\x1b", "\\x1b")
    assert f"store   {shown}\n" in text and "\x1b[31m" not in text
    assert f"report  {shown.removesuffix('.zarr')}-report.html\n" in text


# which figures ------------------------------------------------------------------------------------


def test_each_axis_has_the_wished_the_nominal_or_the_first_value():
    axes = {"pulse_width": [10.0, 50.0], "cnr": [26.0, 29.0], "frame_count": [4, 15, 20]}
    rows = score_rows(scores(**axes, label_rule=["any", "majority"]))
    chosen_rows = at_one_setting(rows, wanted("range profiles"))
    at = {"pulse_width_ns": 10.0, "cnr_db": 26.0, "frame_count": 15, "label_rule": "majority"}
    assert all(at.items() <= row.items() for row in chosen_rows)
    assert [row[BIN] for row in chosen_rows] == ["0-27", "30-57", "overall"]


def test_the_source_is_beside_its_own_ships_aspects_and_settings_alone():
    choices = chosen("+experiment=paper")
    configuration = {
        group: {one.name: list(choices[one]) for one in of.declared if one.key in choices.values}
        for group, of in (
            ("grid", Grid),
            ("scene", Scene),
            ("ladar", Ladar),
            ("infrared", Infrared),
        )
    }
    configuration["ladar"]["phases"] = configuration["infrared"]["phases"] = 1
    rows = score_rows(scores(pulse_width=30.0, frame_count=16))

    def fair(given, **axes):
        rows = score_rows(scores(pulse_width=30.0, frame_count=16, **axes))
        return is_fair(rows, given, (Scene, Ladar))

    assert fair(configuration)
    for group, name, values in (
        ("grid", "ship", ["duncan", "spruance"]),
        ("grid", "aspect", [0, 45, 90]),
        ("ladar", "cnr", [26]),
        ("scene", "depression", 6.7),
    ):
        other = {**configuration, group: {**configuration[group], name: values}}
        assert not fair(other), name
    # Of a setting that is swept, rows at the default are fair and others are not.
    several = {**configuration, "ladar": {**configuration["ladar"], "cnr": [26, 32]}}
    assert fair(several, cnr=32.0) and not fair(several, cnr=26.0)
    assert not is_fair(rows, configuration, ())


# one table ----------------------------------------------------------------------------------------


def test_one_table_is_printed_by_the_name_of_its_file(smoke_store, monkeypatch, capsys):
    names = [Path(name).stem for name in contents(tables_folder(smoke_store))]
    titles = []
    for name in names:
        assert reported(monkeypatch, smoke_store, "--table", name) == 0
        said = capsys.readouterr().out
        titles.append(said.splitlines()[1])
        assert len(said) < len(printed(smoke_store))
    assert len(set(titles)) == len(names) == len(parts_of(smoke_store)) == 10


@pytest.mark.parametrize("name", ["acuracy", "", "[red]", "accuracy.csv"])
def test_a_table_that_is_not_there_is_refused_with_the_names_of_the_others(
    name, smoke_store, monkeypatch, capsys
):
    assert reported(monkeypatch, smoke_store, "--table", name) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
    assert said.err.startswith(f"ncti-report: table is {name!r}, but must be one of categories, ")
    assert "infrared_super_resolution" in said.err
