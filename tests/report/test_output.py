"""Reports write whole files for any screen, and overwrite no file that they did not write."""

import io
import os
import shutil
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made import categories, displayed, scores
from rich.console import Console
from stores import contents, reported, rows_of, signed

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


@pytest.mark.parametrize("screen", ["full", "pipe", "closed"])
def test_tables_are_written_even_if_stdout_is_unwritable(screen, store, monkeypatch, capsys):
    reader, writer = os.pipe()
    os.close(reader)
    device = os.open("/dev/full", os.O_WRONLY) if screen == "full" else writer
    monkeypatch.setattr("sys.stdout", None if screen == "closed" else os.fdopen(device, "w"))
    assert reported(monkeypatch, store) == (screen == "full")
    message = capsys.readouterr().err
    assert message.count("\n") == (screen == "full")
    assert not message or message.startswith("ncti-report: tables cannot be printed: No space left")
    assert files(store) == {"scores.csv", "categories.csv"}


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


HOSTILE = ["=HYPERLINK(1)", "+cmd", "@x", "-x", "\tx", "\rx", "[red]y", "\x1b[31mz", "-5", "+1e3"]


def test_hostile_strings_are_escaped_in_csv_and_terminal(tmp_path):
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
def test_neutralise_formula_keeps_harmless_values(value):
    assert neutralise_formula(value) is value


@pytest.mark.parametrize("what", ["no store", "a file", "empty"])
def test_invalid_store_gives_a_one_line_error(what, tmp_path, monkeypatch, capsys):
    path = tmp_path / "other.zarr"
    if what == "a file":
        path.write_text("{}")
    elif what == "empty":
        path.mkdir()
    assert reported(monkeypatch, path) == 2
    message = capsys.readouterr().err
    assert message.startswith("ncti-report: store is '") and message.count("\n") == 1
    cause = "which does not exist" if what == "no store" else "must be the zarr store of a sweep"
    assert cause in message and not tables_folder(path).exists()


def test_tables_are_printed_even_if_writing_fails(store, monkeypatch, capsys):
    def full(path, content):
        raise OSError("no more room")

    monkeypatch.setattr(outputs, "write_atomically", full)
    assert reported(monkeypatch, store) == 2
    captured = capsys.readouterr()
    assert "identified correctly" in captured.out
    message = captured.err
    assert message.startswith("ncti-report: tables are not written: ") and message.count("\n") == 1


THEIRS = {  # files of a user, and the one that the message names
    "tables": (
        {f"s-tables/{name}.csv": "mine" for name in ("scores", "categories", "scan")},
        "categories.csv",
    ),
    "the list": ({"s-tables/.written": "mine"}, ".written"),
    "a file": ({"s-tables": "mine"}, "s-tables"),
    "a page": ({"s-report.html": "<html>mine</html>"}, "s-report.html"),
}


def everything(folder):
    """Return the bytes of files and the targets of links below a folder, by relative path."""
    return {
        str(path.relative_to(folder)): os.readlink(path) if path.is_symlink() else path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.parametrize("through", ["itself", "link"])
@pytest.mark.parametrize("what", THEIRS)
def test_report_never_overwrites_user_files(what, through, store, tmp_path, monkeypatch, capsys):
    user_files, reported_file = THEIRS[what]
    for name, text in user_files.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        if through == "link":
            (tmp_path / f"their {path.name}").write_text(text)
            path.symlink_to(tmp_path / f"their {path.name}")
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


def test_edited_tables_and_pages_are_kept(store, monkeypatch, capsys):
    assert reported(monkeypatch, "--html", store) == 0
    page = page_file(store)
    before = page.read_bytes()
    assert reported(monkeypatch, "--html", store) == 0 and page.read_bytes() == before
    for path, change in ((tables_folder(store) / "scores.csv", b"?"), (page, b" ")):
        content = path.read_bytes()
        path.write_bytes(content + change)
        capsys.readouterr()
        assert reported(monkeypatch, "--html", store) == 1
        assert path.name in capsys.readouterr().err and path.read_bytes() == content + change
        path.write_bytes(content)


@pytest.mark.parametrize("step", [1, 2, 3])
def test_interrupted_write_keeps_ownership_of_the_file(tmp_path, monkeypatch, step):
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


def test_concurrent_reports_list_the_files_of_both(tmp_path):
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


def test_report_files_are_writable_by_the_owner_only(store, monkeypatch, umask):
    umask(0)
    assert reported(monkeypatch, "--html", store) == 0
    folder = tables_folder(store)
    modes = {path.stat().st_mode & 0o777 for path in (*folder.iterdir(), page_file(store))}
    assert modes == {0o644} and folder.stat().st_mode & 0o777 == 0o755


DAMAGES = [  # of a file: its name, what it is replaced by, and the options that refuse it
    (f"{GROUP}/accuracy/zarr.json", b"{}", [[], ["--html"]]),
    (f"{GROUP}/accuracy/c/0/0/0/0/0", None, [[], ["--html"]]),
    (f"{GROUP}/accuracy/c/9", b"", [[], ["--html"]]),
    ("range_profile/accuracy/c/0/0", b"?", [["--html"]]),
]


@pytest.mark.parametrize(("name", "content", "refused"), DAMAGES, ids=str)
def test_report_refuses_damaged_store_files(name, content, refused, store, monkeypatch, capsys):
    """Files that the tables do not need are verified for the page alone."""
    scores(a=[1, 2]).to_zarr(store, group="range_profile", mode="a", consolidated=False)
    signed(store)
    if content is None:
        (store / name).unlink()
    else:
        (store / name).write_bytes(content)
    for options in ([], ["--html"]):
        assert reported(monkeypatch, *options, store) == (2 if options in refused else 0)
        captured = capsys.readouterr()
        if options in refused:
            assert captured.err.startswith("ncti-report: store is '") and not captured.out
            assert captured.err.count("\n") == 1 and name in captured.err
    assert not page_file(store).exists()


def test_every_store_has_a_folder_of_its_own(tmp_path):
    names = ["q", "q.zarr", "q.zarr.zarr", "q-tables", "q.v1", "q.v1.zarr", ".zarr"]
    folders = {tables_folder(tmp_path / name) for name in names}
    assert len(folders) == len(names)
    assert tables_folder(tmp_path / "q.zarr").name == "q-tables"
    assert all(folder.parent == tmp_path for folder in folders)


def test_obsolete_tables_are_removed_but_user_files_are_kept(tmp_path):
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
def test_damaged_file_list_deletes_nothing(listed, tmp_path):
    folder = tmp_path / "s-tables"
    folder.mkdir()
    for path in (folder / "theirs.csv", tmp_path / "theirs.csv"):
        path.write_text("kept")
    (folder / LIST_NAME).write_bytes(listed)
    # It may be the user's own file, which is not replaced.
    assert write(folder, "scores") == [folder / LIST_NAME]
    assert set(contents(tmp_path)) == {"theirs.csv", "s-tables/theirs.csv"}
    assert (folder / LIST_NAME).read_bytes() == listed
