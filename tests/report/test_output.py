"""The report costs no results: files come first and whole, and any screen will do."""

import io
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from made import formed, scores
from rich.console import Console
from stores import contents, reported, rows_of

from sweeps.engine.errors import ConfigurationError
from sweeps.report.command import report
from sweeps.report.places import tables_folder
from sweeps.report.screen import FILES, WRITTEN, neutral, write_tables

GROUP = "tables/acn"
AXES = {"pulse_width": [30.0], "range": [100.0], "vigilance": [0.95], "frame_count": [4]}


def made(path, **axes):
    """A store of one table."""
    tables = scores(prefixes=("", "training_"), **AXES, target_free_ifovs=4000, **axes)
    formed(tables, over=("pulse_width", "vigilance")).to_zarr(
        path, group=GROUP, mode="w", consolidated=False
    )
    return path


@pytest.fixture
def store(tmp_path):
    return made(tmp_path / "s.zarr")


def in_shell(store, shell, **environment):
    """`ncti-report` in a shell, where `COMMAND` stands for the command."""
    program = "from sweeps.report.command import main; main()"
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {shell}"],
        env=os.environ
        | {"PYTHON": sys.executable, "PROGRAM": program, "STORE": str(store)}
        | environment,
        cwd=store.parent,
        capture_output=True,
        timeout=120,
    )


COMMAND = '"$PYTHON" -c "$PROGRAM" "$STORE"'


def files(store):
    return set(contents(tables_folder(store)))


@pytest.mark.parametrize(
    ("shell", "environment", "said"),
    [
        (f"{COMMAND} | true", {}, 0),
        (f"{COMMAND} > /dev/full", {}, 1),
        (f"{COMMAND} >&-", {}, 0),
        (f"{COMMAND} > /dev/full 2> /dev/full", {}, 0),
        (COMMAND, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, 0),
        (
            COMMAND,
            {"PYTHONIOENCODING": "latin-1", "COLUMNS": "10", "TERM": "dumb", "FORCE_COLOR": "1"},
            0,
        ),
    ],
    ids=["pipe", "full", "closed", "both full", "C", "narrow and coloured"],
)
def test_a_screen_that_takes_nothing_costs_nothing(store, shell, environment, said):
    done = in_shell(store, shell, **environment)
    assert done.returncode == 0
    told = done.stderr.decode()
    assert told.count("\n") == said and "Traceback" not in told and "Exception" not in told
    assert said == 0 or told.startswith("ncti-report: tables cannot be printed: No space left")
    assert files(store) == {"accuracy.csv", "categories.csv"}


def test_an_ascii_screen_has_every_figure(store, monkeypatch):
    def printed(encoding):
        screen = io.TextIOWrapper(io.BytesIO(), encoding)
        monkeypatch.setattr("sys.stdout", screen)
        assert reported(monkeypatch, store) == 0
        return screen.buffer.getvalue().decode(encoding)

    plain, whole = printed("ascii"), printed("utf-8")
    figures = rows_of(store, "accuracy")
    for row in figures:
        text = f"{float(row['percent_correct']):.0f} [{float(row['ci_low']):.0f}-"
        assert text in plain and text in whole
    assert "\n----" in plain and "\n────" in whole


@pytest.mark.parametrize("name", ["[red]x.zarr", "[/]x.zarr", "a b\x1b[31mc.zarr", "é\n.zarr"])
def test_names_of_paths_are_shown_as_they_are(name, tmp_path):
    path = made(tmp_path / name)
    console = Console(file=io.StringIO(), width=100, force_terminal=True, color_system="truecolor")
    report(path, console)
    text = console.file.getvalue()
    shown = name.replace("\x1b", "\\x1b").replace("\n", "\\n")
    assert f"store   {tmp_path}/{shown}\n" in text
    assert "\x1b[31m" not in text
    assert files(path) == {"accuracy.csv", "categories.csv"}


HOSTILE = ["=HYPERLINK(1)", "+cmd", "@x", "-x", "\tx", "\rx", "[red]y", "\x1b[31mz", "-5", "+1e3"]


def test_words_of_a_store_are_neutral_in_files_and_on_the_screen(tmp_path):
    path = made(tmp_path / "s.zarr", word=np.array(HOSTILE, dtype=object).tolist())
    console = Console(file=io.StringIO(), width=300)
    report(path, console)
    with (tables_folder(path) / "accuracy.csv").open(newline="") as file:
        text = file.read()
    found = dict.fromkeys(row["word"] for row in rows_of(path, "accuracy"))
    kept = {"[red]y", "\x1b[31mz", "-5", "+1e3"}
    assert set(found) == kept | {f"'{word}" for word in set(HOSTILE) - kept}
    assert not [line for line in text.splitlines() if line.startswith(("=", "@", "\t"))]
    printed = console.file.getvalue()
    for word in HOSTILE:
        shown = word.replace("\t", "\\t").replace("\r", "\\r").replace("\x1b", "\\x1b")
        assert f"word {shown})" in " ".join(printed.split())
    assert not any(ord(one) < 32 and one != "\n" for one in printed)


@pytest.mark.parametrize("value", ["-5", "+1e3", "-0.5", "x=1", "", " ", 5, -5.0, None, True])
def test_numbers_and_other_words_stay(value):
    assert neutral(value) is value


@pytest.mark.parametrize("damage", ["no store", "a file", "empty", "cut", "no variable", "lost"])
def test_what_is_no_good_store_is_refused_in_one_sentence(
    damage, store, tmp_path, monkeypatch, capsys
):
    path = store
    if damage == "no store":
        path = tmp_path / "absent.zarr"
    elif damage in ("a file", "empty"):
        path = tmp_path / "other.zarr"
        path.mkdir() if damage == "empty" else path.write_text("{}")
    elif damage == "cut":
        for one in (store / GROUP).rglob("zarr.json"):
            one.write_text(one.read_text()[:40])
    elif damage == "lost":
        for one in (store / GROUP / "accuracy").rglob("*"):
            if one.is_file() and one.name != "zarr.json":
                one.write_bytes(b"?")
    else:
        shutil.rmtree(store / GROUP / "ci_low")
    assert reported(monkeypatch, path) == 2
    told = capsys.readouterr().err
    assert told.startswith("ncti-report: store is '") and told.count("\n") == 1
    assert "must be the zarr store of a sweep" in told
    assert not tables_folder(path).exists()
    with pytest.raises(ConfigurationError):
        report(path, Console(file=io.StringIO()))


def test_tables_that_cannot_be_written_are_printed_all_the_same(store, monkeypatch, capsys):
    tables_folder(store).write_text("in the way")
    assert reported(monkeypatch, store) == 2
    said = capsys.readouterr()
    assert "Percent correct" in said.out
    told = said.err
    assert told.startswith("ncti-report: tables are not written: ") and told.count("\n") == 1


def test_every_store_has_a_folder_of_its_own(tmp_path):
    names = ["q", "q.zarr", "q.zarr.zarr", "q-tables", "q.v1", "q.v1.zarr", ".zarr"]
    folders = {tables_folder(tmp_path / name) for name in names}
    assert len(folders) == len(names)
    assert tables_folder(tmp_path / "q.zarr").name == "q-tables"
    assert all(folder.parent == tmp_path for folder in folders)


def test_files_of_an_earlier_run_go_and_others_stay(store):
    folder = tables_folder(store)
    folder.mkdir()
    for name in (*FILES, "mine"):
        (folder / f"{name}.csv").write_text("old")
    (folder / "flight.png").write_text("old")
    report(store, Console(file=io.StringIO()))
    assert files(store) == {"accuracy.csv", "categories.csv", "mine.csv", "flight.png"}
    assert (folder / "accuracy.csv").read_text() != "old"


def test_files_of_tables_that_a_new_sweep_lacks_go_and_what_others_wrote_stays(tmp_path):
    rows = [{"a": 1}]
    (tmp_path / "theirs.csv").write_text("kept")
    write_tables(tmp_path, {"accuracy": rows, "pears": rows, "plums": rows, "figs": rows})
    (tmp_path / "plums.csv").write_text("changed by hand")
    for _ in range(2):  # whoever ran last
        write_tables(tmp_path, {"accuracy": rows, "figs": rows})
        assert set(contents(tmp_path)) == {"accuracy.csv", "figs.csv", "plums.csv", "theirs.csv"}
    write_tables(tmp_path, {"plums": rows})
    assert set(contents(tmp_path)) == {"plums.csv", "theirs.csv"}
    assert (tmp_path / "theirs.csv").read_text() == "kept"


@pytest.mark.parametrize("listed", [b"\xff", b"0  ../theirs.csv\n", b"x", b"0  theirs.csv\n"])
def test_a_list_of_files_that_is_damaged_costs_no_file(listed, tmp_path):
    folder = tmp_path / "tables"
    folder.mkdir()
    for path in (folder / "theirs.csv", tmp_path / "theirs.csv"):
        path.write_text("kept")
    (folder / WRITTEN).write_bytes(listed)
    write_tables(folder, {"accuracy": [{"a": 1}]})
    assert set(contents(tmp_path)) == {"theirs.csv", "tables/theirs.csv", "tables/accuracy.csv"}


def test_a_file_is_whole_or_not_there(tmp_path, monkeypatch):
    write_tables(tmp_path, {"accuracy": [{"a": 1}]})

    def failing(self, content):
        with self.open("wb") as file:
            file.write(content[:2])
        raise OSError("no more room")

    monkeypatch.setattr("pathlib.Path.write_bytes", failing)
    with pytest.raises(OSError, match="no more room"):
        write_tables(tmp_path, {"accuracy": [{"a": 2}]})
    monkeypatch.undo()
    assert contents(tmp_path) == {"accuracy.csv": b"a\r\n1\r\n"}


def test_every_file_of_a_store_is_known(smoke_store):
    names = {name.removesuffix(".csv") for name in files(smoke_store)}
    assert names and names <= set(FILES)
    tables = xr.open_zarr(smoke_store, group=GROUP)
    assert len(rows_of(smoke_store, "categories")) == tables.category_count.size
