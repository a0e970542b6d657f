"""The page at the end of a sweep: short, fair to the source, and of figures that the files have."""

import io
import re
import shlex
from pathlib import Path

import pytest
from commands import chosen, prepared
from made import SOURCE, formed, scores
from rich.cells import cell_len
from rich.console import Console
from stores import contents, printed, reported, rows_of

from sweeps.report.fair import compared
from sweeps.report.headline import SCORE, _print_sections, at_common_setting, at_one_setting
from sweeps.report.own import PAGE, UNKNOWN, sealed
from sweeps.report.parts import parts_of
from sweeps.report.places import page_file, tables_folder
from sweeps.report.rows import BIN, beside_source, score_rows
from sweeps.report.summary import continued, extended, summarize, swept
from sweeps.report.tables import accuracy_rows
from sweeps.stages.views import Grid

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
    page_file(path).write_bytes(sealed(f'<meta name="{PAGE}" content="{UNKNOWN}">'))
    console = Console(file=io.StringIO(), width=100, force_terminal=True)
    summarize(path, chosen(), {}, console, given=["grid.ship=[duncan]"])
    text = console.file.getvalue()
    shown = name.replace("\x1b", "\\x1b")
    assert f"store   {shown}\n" in text and "\x1b[31m" not in text
    assert f"report  {shown.removesuffix('.zarr')}-report.html\n" in text


# which figures ------------------------------------------------------------------------------------


def test_each_axis_has_the_preferred_or_the_first_value():
    axes = {"pulse_width": [10.0, 50.0], "cnr": [26.0, 29.0], "frame_count": [4, 15, 20]}
    rows = score_rows(scores(**axes, label_rule=["any", "majority"]))
    chosen_rows = at_one_setting(rows)
    at = {"pulse_width_ns": 10.0, "cnr_db": 29.0, "frame_count": 15, "label_rule": "majority"}
    assert all(at.items() <= row.items() for row in chosen_rows)
    assert [row[BIN] for row in chosen_rows] == ["0-27", "30-57", "overall"]


def test_rows_of_a_sensor_are_at_one_setting_where_they_have_it():
    def of(*ranges):
        return score_rows(scores(range=list(ranges), frame_count=16))

    for ranges, found in (
        (([25.0, 50.0, 100.0], [100.0]), [100.0, 100.0]),
        (([25.0, 50.0, 100.0], [50.0]), [50.0, 50.0]),
        (([25.0, 50.0], [75.0, 200.0]), [50.0, 75.0]),
    ):
        lines = at_common_setting([of(*one) for one in ranges])
        assert [{row["range_km"] for row in line} for line in lines] == [{one} for one in found]


def test_a_row_at_another_setting_names_it():
    section = [
        (name, at_one_setting(score_rows(scores(range=[distance], frame_count=16))))
        for name, distance in (("ACN", 50.0), ("similarity", 100.0))
    ]
    console = Console(file=io.StringIO(), width=100)
    _print_sections({"silhouettes": section}, console)
    text = console.file.getvalue()
    assert "similarity, 100 km" in text and "ACN " in text and "ACN, " not in text
    assert "silhouettes: 50 km, 16 frames. " in text


def test_silhouettes_of_the_page_and_the_screen_are_at_the_range_that_is_named(smoke_store):
    text = " ".join(page(smoke_store).split())
    assert "silhouettes: 100 km, vigilance 0.87, 16 frames" in text
    at = {"range_km": "100.0", "frame_count": "16", "super_resolution": "none"}
    acn = [
        row
        for row in rows_of(smoke_store, "infrared_accuracy")
        if at.items() <= row.items() and row["silhouettes"] != "training"
    ]
    at |= {"infrared_frame_count": "16", "pulse_width_ns": "30.0", "channel": "infrared"}
    both = [row for row in rows_of(smoke_store, "fusion") if at.items() <= row.items()]
    section = page(smoke_store).split("silhouettes", 1)[1].splitlines()
    for line, rows in zip(section[1:3], (acn, both), strict=True):
        figures = ["{:.0f} [{:.0f}-{:.0f}]".format(*(float(row[s]) for s in SCORE)) for row in rows]
        assert re.split(r" {2,}", line.strip())[1:] == figures and len(figures) == 4


def with_settings(table, digests=None, **changed):
    """That table of the article's ships and aspects, with some settings changed."""
    configuration = SOURCE["configuration"] | changed
    digests = SOURCE["mesh_digests"] | (digests or {})
    return compared(table, {"configuration": configuration, "mesh_digests": digests})


@pytest.mark.parametrize(
    ("changed", "digests", "fair"),
    [
        ({}, {}, True),
        ({"ladar": {"cnr": 32}}, {}, True),
        ({"ladar": {"cnr": 12}}, {}, False),
        ({"scene": {"depression": 6.7}}, {}, False),
        ({"classifier": {"template_spacing": 6}}, {}, False),
        ({"classifier": {"learn_in_test": True}}, {}, False),
        ({"infrared": {"nedt": 1}}, {}, True),  # profiles do not depend on it
        ({"grid": {"aspect": [0, 45, 90]}}, {}, False),
        ({"grid": {"aspect": [*range(0, 91, 3), 1]}}, {}, False),
        ({}, {"texas": "another mesh"}, False),
        ({}, {"iowa": "a fifth ship"}, False),
    ],
)
def test_the_source_is_beside_its_own_ships_aspects_and_settings_alone(changed, digests, fair):
    axes = {"pulse_width": 30.0, "frame_count": [8, 16], "range": 100.0, "vigilance": 0.95}
    table = with_settings(scores(**axes, prefixes=("", "training_")), digests, **changed)
    theirs = [63, 20, None, 78, 40, None] if fair else [None] * 6
    rows = beside_source(score_rows(table), table, "acn")
    assert [row["source_percent"] for row in rows] == theirs
    rows = accuracy_rows(table)
    assert [row["source_percent"] for row in rows if row["frame_count"]] == theirs


def test_of_a_setting_that_is_swept_only_rows_at_its_default_are_compared():
    axes = {"pulse_width": 30.0, "frame_count": 16, "range": 100.0, "vigilance": 0.95}
    table = with_settings(scores(**axes, cnr=[26.0, 32.0]), ladar={"cnr": [26, 32]})
    rows = beside_source(score_rows(table), table, "acn")
    assert {row["cnr_db"] for row in rows if row["source_percent"] is not None} == {32.0}


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
