"""Reports write whole files for any screen, and overwrite no file that they did not write."""

import io
import os
import shutil
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from forked import statuses
from made import categories, displayed, scores
from rich.console import Console
from stores import contents, reported, rows_of, signed

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.store.manifest import MANIFEST
from sweeps.report import outputs
from sweeps.report.files import neutralise_formula, write_tables
from sweeps.report.frames import Column, Frame, read_frames
from sweeps.report.outputs import LIST_NAME, page_file, tables_folder
from sweeps.report.pivot import lay_out
from sweeps.report.summary import report
from sweeps.report.terminal import entry_text

GROUP = "tables/acn"
AXES = {"pulse_width": [30.0], "range": [100.0], "vigilance": [0.95], "frame_count": [4]}


def made(path, **axes):
    """Write a store of two tables."""
    tables = displayed(scores(prefixes=("", "training_"), **AXES, target_free_ifovs=4000, **axes))
    tables.to_zarr(path, group=GROUP, mode="w", consolidated=False)
    formed = categories(7, pulse_width=[30.0], vigilance=[0.95])
    formed.to_zarr(path, group="tables/categories_acn", mode="w", consolidated=False)
    return signed(path)


def table(name, value=1):
    """Return a frame of one cell."""
    return Frame(name, name, pd.DataFrame({"a": [value]}), {"a": Column("a", "a", "a")})


def write(folder, *names, value=1):
    """Write tables of one cell into a store's folder; return paths of files not overwritten."""
    return write_tables(
        folder.with_name(folder.name.removesuffix("-tables") + ".zarr"),
        [table(name, value) for name in names],
    )


@pytest.fixture(scope="module")
def whole_store(tmp_path_factory):
    return made(tmp_path_factory.mktemp("one") / "s.zarr")


@pytest.fixture
def store(whole_store, tmp_path):
    return Path(shutil.copytree(whole_store, tmp_path / "s.zarr"))


def files(store):
    return set(contents(tables_folder(store)))


SMALL = {"COLUMNS": "10", "TERM": "dumb", "FORCE_COLOR": "1"}
SCREENS = {  # stdout, stderr, environment
    "pipe": ("pipe", "utf-8", {}),
    "full": ("full", "utf-8", {}),
    "closed": ("closed", "utf-8", {}),
    "both full": ("full", "full", {}),
    "ascii": ("ascii", "ascii", {}),
    "narrow and coloured": ("latin-1", "latin-1", SMALL),
}


@pytest.fixture(scope="module")
def ended(whole_store, tmp_path_factory):
    """Return the folder and the exit status of a report for each screen."""
    folders = {name: tmp_path_factory.mktemp("screen") for name in SCREENS}
    cases = []
    for name, (out, err, environment) in SCREENS.items():
        shutil.copytree(whole_store, folders[name] / "s.zarr")
        case = {"output": (out, err), "environment": environment, "arguments": ["s.zarr"]}
        cases.append(case | {"folder": str(folders[name])})
    exit_codes = statuses("report_process", "main", cases)
    return dict(zip(folders, zip(folders.values(), exit_codes, strict=True), strict=True))


@pytest.mark.parametrize("screen", SCREENS)
def test_a_screen_that_takes_nothing_costs_nothing(ended, screen):
    folder, status = ended[screen]
    assert status == ("full" in screen)
    message = (folder / "err").read_text("latin-1") if screen != "both full" else ""
    assert message.count("\n") == (screen == "full")
    assert "Traceback" not in message and "Exception" not in message
    assert not message or message.startswith("ncti-report: tables cannot be printed: No space left")
    assert files(folder / "s.zarr") == {"scores.csv", "categories.csv"}


def test_an_ascii_screen_has_every_figure(store, monkeypatch):
    def printed(encoding):
        screen = io.TextIOWrapper(io.BytesIO(), encoding)
        monkeypatch.setattr("sys.stdout", screen)
        assert reported(monkeypatch, store, "--table", "scores") == 0
        return screen.buffer.getvalue().decode(encoding)

    ascii_text, full_text = printed("ascii"), printed("utf-8")
    for cells in [line.cells for line in lay_out(read_frames(store)["scores"]).lines]:
        for cell in cells:
            assert (
                entry_text(cell) in full_text and entry_text(cell).replace("–", "-") in ascii_text
            )
    assert "\n────" in full_text and "\n----" in ascii_text.replace("?", "-")


@pytest.mark.parametrize("name", ["[red]x.zarr", "[/]x.zarr", "a b\x1b[31mc.zarr", "é\n.zarr"])
def test_names_of_paths_are_shown_as_they_are(name, tmp_path):
    path = made(tmp_path / name)
    console = Console(file=io.StringIO(), width=100, force_terminal=True, color_system="truecolor")
    report(path, console)
    text = console.file.getvalue()
    printable = name.replace("\x1b", "\\x1b").replace("\n", "\\n")
    assert f"store   {tmp_path}/{printable}\n" in text
    assert "\x1b[31m" not in text
    assert files(path) == {"scores.csv", "categories.csv"}


HOSTILE = ["=HYPERLINK(1)", "+cmd", "@x", "-x", "\tx", "\rx", "[red]y", "\x1b[31mz", "-5", "+1e3"]


def test_words_of_a_store_are_neutral_in_files_and_on_the_screen(tmp_path):
    path = made(tmp_path / "s.zarr", word=np.array(HOSTILE, dtype=object).tolist())
    console = Console(file=io.StringIO(), width=300)
    report(path, console)
    with (tables_folder(path) / "scores.csv").open(newline="") as file:
        text = file.read()
    words = dict.fromkeys(row["word"] for row in rows_of(path, "scores"))
    unchanged = {"[red]y", "\x1b[31mz", "-5", "+1e3"}
    assert set(words) == unchanged | {f"'{word}" for word in set(HOSTILE) - unchanged}
    assert not [line for line in text.splitlines() if line.startswith(("=", "@", "\t"))]
    printed = console.file.getvalue()
    for word in HOSTILE:
        printable = word.replace("\t", "\\t").replace("\r", "\\r").replace("\x1b", "\\x1b")
        assert printable in printed
    assert not any(ord(letter) < 32 and letter != "\n" for letter in printed)


@pytest.mark.parametrize("value", ["-5", "+1e3", "-0.5", "x=1", "", " ", 5, -5.0, None, True])
def test_numbers_and_other_words_stay(value):
    assert neutralise_formula(value) is value


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
        for file in (store / GROUP).rglob("zarr.json"):
            file.write_text(file.read_text()[:40])
    elif damage == "lost":
        for file in (store / GROUP / "accuracy").rglob("*"):
            if file.is_file() and file.name != "zarr.json":
                file.write_bytes(b"?")
    else:
        shutil.rmtree(store / GROUP / "ci_low")
    assert reported(monkeypatch, path) == 2
    message = capsys.readouterr().err
    assert message.startswith("ncti-report: store is '") and message.count("\n") == 1
    cause = "which does not exist" if damage == "no store" else "must be the zarr store of a sweep"
    assert cause in message
    assert not tables_folder(path).exists()
    with pytest.raises(ConfigurationError):
        report(path, Console(file=io.StringIO()))


def test_tables_that_cannot_be_written_are_printed_all_the_same(store, monkeypatch, capsys):
    def full(path, content):
        raise OSError("no more room")

    monkeypatch.setattr(outputs, "write_atomically", full)
    assert reported(monkeypatch, store) == 2
    captured = capsys.readouterr()
    assert "identified correctly" in captured.out
    message = captured.err
    assert message.startswith("ncti-report: tables are not written: ") and message.count("\n") == 1


def link_of(path, target):
    target.write_text("mine")
    path.symlink_to(target)


THEIRS = {  # files of a user, and the one that the message names
    "a table": ({"s-tables/scores.csv": "mine", "s-tables/scan.csv": "mine"}, "scores.csv"),
    "tables": (
        {f"s-tables/{name}.csv": "mine" for name in ("scores", "categories")},
        "categories.csv",
    ),
    "the list": ({"s-tables/.written": "mine"}, ".written"),
    "a file": ({"s-tables": "mine"}, "s-tables"),
    "a page": ({"s-report.html": "<html>mine</html>"}, "s-report.html"),
}


def everything(folder):
    """Return the bytes of files and the targets of links below a folder, by relative path."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    } | {
        str(path.relative_to(folder)): os.readlink(path)
        for path in folder.rglob("*")
        if path.is_symlink()
    }


@pytest.mark.parametrize("through", ["itself", "link"])
@pytest.mark.parametrize("what", THEIRS)
def test_what_the_report_did_not_write_stays(what, through, store, tmp_path, monkeypatch, capsys):
    user_files, reported_file = THEIRS[what]
    for name, text in user_files.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        if through == "link":
            link_of(path, tmp_path / f"their {path.name}")
        else:
            path.write_text(text)
    before = everything(tmp_path)
    assert reported(monkeypatch, "--html", store) == 1
    captured = capsys.readouterr()
    assert "identified correctly" in captured.out and captured.err.count("\n") == 1
    assert captured.err.startswith("ncti-report: ") and reported_file in captured.err
    assert captured.err.endswith(
        " not overwritten: not created by ncti-report, or edited since; "
        "everything else is written\n"
    )
    after = everything(tmp_path)
    assert before.items() <= after.items()
    written = {name for name in after if name not in before and not name.startswith("s-tables/.")}
    expected = {"s-tables/scores.csv", "s-tables/categories.csv", "s-report.html"}
    gone = {name for name in expected if what in ("the list", "a file") and "tables" in name}
    assert written == expected - set(user_files) - gone
    for name in user_files:
        shutil.rmtree(tmp_path / name) if (tmp_path / name).is_dir() else (tmp_path / name).unlink()
    assert reported(monkeypatch, "--html", store) == 0
    assert expected <= set(everything(tmp_path))


def test_a_folder_behind_a_link_keeps_what_it_has(store, tmp_path, monkeypatch):
    (tmp_path / "theirs").mkdir()
    for name in ("scores.csv", "scan.csv"):
        (tmp_path / "theirs" / name).write_text("mine")
    tables_folder(store).symlink_to(tmp_path / "theirs")
    for _ in range(2):
        assert reported(monkeypatch, store) == 1
        assert {
            (tmp_path / "theirs" / name).read_text() for name in ("scores.csv", "scan.csv")
        } == {"mine"}
    assert files(store) == {"scores.csv", "scan.csv", "categories.csv"}


def test_changed_tables_and_pages_stay(store, tmp_path, monkeypatch, capsys):
    assert reported(monkeypatch, "--html", store) == 0
    page = page_file(store)
    before = page.read_bytes()
    assert reported(monkeypatch, "--html", store) == 0 and page.read_bytes() == before
    for path, change in (
        (tables_folder(store) / "scores.csv", b"?"),
        (page, b" "),
        (page, b"<!-- my note -->"),
    ):
        content = path.read_bytes()
        path.write_bytes(content + change)
        capsys.readouterr()
        assert reported(monkeypatch, "--html", store) == 1
        assert path.name in capsys.readouterr().err and path.read_bytes() == content + change
        path.write_bytes(content)
        assert reported(monkeypatch, "--html", store) == 0


@pytest.mark.parametrize("step", [1, 2, 3])
def test_an_interrupt_between_list_and_file_leaves_an_own_file(tmp_path, monkeypatch, step):
    folder = tmp_path / "s-tables"
    write(folder, "scores")
    written, put = [], outputs.write_atomically

    def interrupted(path, content):
        written.append(path)
        if len(written) == step:
            raise KeyboardInterrupt
        put(path, content)

    monkeypatch.setattr(outputs, "write_atomically", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(folder, "scores", value=2)
    monkeypatch.undo()
    assert write(folder, "scores", value=3) == []
    assert contents(folder) == {"scores.csv": b"a\r\n3\r\n"}


def put_each(folder, names):
    """Write files one by one, as a report does."""
    for name in names:
        outputs.write_own_files(folder, {name: name.encode()})


def test_reports_at_once_list_the_files_of_both(tmp_path):
    names = [[f"{process}-{k}.csv" for k in range(100)] for process in range(2)]
    context = get_context("fork")
    processes = [context.Process(target=put_each, args=(tmp_path, group)) for group in names]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
        assert process.exitcode == 0
    listed = [line.partition("  ")[2] for line in (tmp_path / LIST_NAME).read_text().splitlines()]
    assert sorted(listed) == sorted(names[0] + names[1])
    assert {path.name for path in tmp_path.iterdir()} == {LIST_NAME, *names[0], *names[1]}


@pytest.mark.parametrize("mask", [0, 0o077])
def test_others_never_write_what_the_report_wrote(store, monkeypatch, mask, umask):
    umask(mask)
    assert reported(monkeypatch, "--html", store) == 0
    folder = tables_folder(store)
    modes = {path.stat().st_mode & 0o777 for path in (*folder.iterdir(), page_file(store))}
    assert modes == {0o644 & ~mask} and folder.stat().st_mode & 0o777 == 0o755 & ~mask


def files_of(path):
    return [file for file in sorted(path.rglob("*")) if file.is_file() and file.name != MANIFEST]


def test_a_report_is_made_of_whole_files_only(tmp_path, monkeypatch, capsys):
    path = made(tmp_path / "s.zarr")
    scores(a=[1, 2]).to_zarr(path, group="range_profile", mode="a", consolidated=False)
    signed(path)
    chunks = [file for file in files_of(path) if "/c" in str(file.relative_to(path))]
    assert len(chunks) > 20
    for file in files_of(path):
        content, name = file.read_bytes(), str(file.relative_to(path))
        always_read = name.startswith("tables/") or name.endswith("zarr.json")
        for damaged in (None, content + b"?"):
            file.unlink() if damaged is None else file.write_bytes(damaged)
            for options in ([],) if always_read else (["--html"], []):
                status = 2 if always_read or options else 0
                assert reported(monkeypatch, *options, path) == status
                captured = capsys.readouterr()
                if status:
                    assert captured.err.startswith("ncti-report: store is '") and not captured.out
                    assert captured.err.count("\n") == 1 and name in captured.err
        file.write_bytes(content)
    (path / GROUP / "accuracy" / "c" / "9").write_bytes(b"")
    assert reported(monkeypatch, path) == 2
    assert not page_file(path).exists()


def test_every_store_has_a_folder_of_its_own(tmp_path):
    names = ["q", "q.zarr", "q.zarr.zarr", "q-tables", "q.v1", "q.v1.zarr", ".zarr"]
    folders = {tables_folder(tmp_path / name) for name in names}
    assert len(folders) == len(names)
    assert tables_folder(tmp_path / "q.zarr").name == "q-tables"
    assert all(folder.parent == tmp_path for folder in folders)


def test_files_of_tables_that_a_new_sweep_lacks_go_and_what_others_wrote_stays(tmp_path):
    folder = tmp_path / "s-tables"
    write(folder, "scores", "pears", "plums", "figs")
    (folder / "theirs.csv").write_text("kept")
    (folder / "plums.csv").write_text("changed by hand")
    for _ in range(2):  # a second report changes nothing
        write(folder, "scores", "figs")
        assert set(contents(folder)) == {"scores.csv", "figs.csv", "plums.csv", "theirs.csv"}
    write(folder, "plums")
    assert set(contents(folder)) == {"plums.csv", "theirs.csv"}
    assert (folder / "theirs.csv").read_text() == "kept"


@pytest.mark.parametrize("listed", [b"\xff", b"0  ../theirs.csv\n", b"x", b"0  theirs.csv\n"])
def test_a_list_of_files_that_is_damaged_costs_no_file(listed, tmp_path):
    folder = tmp_path / "s-tables"
    folder.mkdir()
    for path in (folder / "theirs.csv", tmp_path / "theirs.csv"):
        path.write_text("kept")
    (folder / LIST_NAME).write_bytes(listed)
    # It may be the user's own file, which is not replaced.
    assert write(folder, "scores") == [folder / LIST_NAME]
    assert set(contents(tmp_path)) == {"theirs.csv", "s-tables/theirs.csv"}
    assert (folder / LIST_NAME).read_bytes() == listed
