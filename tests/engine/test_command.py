"""The command line: its exit statuses and messages, and that failing output loses no results."""

import errno
import signal
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
import yaml
from forked import statuses
from small_stores import files
from toys import CALLS, SPRINGS

from sweeps.engine.command import line
from sweeps.engine.command.line import Command
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.kinds import format_value
from sweeps.engine.objects import UNREACHABLE, Objects


@pytest.fixture
def start(tmp_path, monkeypatch):
    """Return a function that runs a command line in a new folder and returns its exit status."""
    monkeypatch.chdir(tmp_path)

    def start(*arguments):
        CALLS.clear()
        return Command(SPRINGS).main(["cache=cache", "cluster=inline", *arguments])

    return start


def test_store_defaults_to_the_working_directory(start, tmp_path):
    assert start() == 0
    assert {path.name for path in tmp_path.iterdir()} == {"cache", "sweep.zarr"}
    assert start() == 0 and not CALLS
    assert start("hydra.run.dir=asked", "spring.mass=9") == 0
    assert (tmp_path / "asked" / "sweep.zarr").is_dir()
    assert start("hydra.run.dir=asked", "spring.mass=nan") == 2


def test_settings_option_lists_and_searches_settings(capsys):
    main = Command(SPRINGS).main
    assert main(["--settings"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) < 80
    words = " ".join(" ".join(lines).split())
    for setting in SPRINGS.declared:
        assert f"{setting.key}={format_value(setting.default_input)}" in words
        assert f" {setting.label} " in words and setting.kind.allowed in words
    assert main(["--settings", "mass"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "spring.mass=[1, 2] [kg]"
    assert main(["--settings", "compared", "WITH"]) == 0
    assert capsys.readouterr().out.startswith("spring.reference=null [N m-1]\n")
    assert main(["--settings", "colour"]) == 2
    (message,) = capsys.readouterr().err.splitlines()
    assert "'colour'" in message


def test_sweep_prints_tables_store_path_and_next_command(start, capsys):
    assert start("store=a b.zarr") == 0
    for counted in ("74 cells to compute, 0 reused from the cache", "74 are in the store"):
        output = capsys.readouterr()
        assert counted in output.err
        words, table, end = output.out.split("\n\n")
        assert words.startswith("Best ") and words.endswith(".")
        assert "best" in table.split("\n")[0] and "[kg]" in table and len(table.split("\n")) > 2
        assert end == "store   a b.zarr\nnext    ncti-report 'a b.zarr'\n"
        assert start("store=a b.zarr") == 0 and not CALLS


@pytest.mark.parametrize(
    ("number", "verb", "status"),
    [
        (errno.EACCES, "access", 2),
        (errno.EMFILE, "access", 1),
        (errno.ENOSPC, "write", 1),
        (UNREACHABLE, "reach", 1),
    ],
)
def test_io_errors_are_reported_in_one_line(start, capsys, monkeypatch, number, verb, status):
    def fail(objects, under=""):
        raise OSError(number, "no luck", "cache/cells")

    monkeypatch.setattr(Objects, "list_objects", fail)
    assert start("--cache") == status
    assert capsys.readouterr().err == f"springs: cannot {verb} 'cache/cells': no luck\n"


def test_workers_prepare_before_the_first_cell(capsys, tmp_path, monkeypatch):
    """Each of two functions is called once; the message about them precedes the last line."""
    monkeypatch.chdir(tmp_path)

    def prepare(choices, say):
        say("compiling the loops")
        return [partial(Path.touch, tmp_path / name, exist_ok=False) for name in "ab"]

    compiling = replace(SPRINGS, prepare=prepare)
    assert Command(compiling).main(["cache=cache", "cluster=local"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines.index("springs: compiling the loops") < len(lines) - 1 and "computed" in lines[-1]
    assert Path("a").exists() and Path("b").exists()


def test_failing_preparation_is_reported_in_one_line(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    missing = partial(Path.unlink, tmp_path / "loops")
    failing = replace(SPRINGS, prepare=lambda choices, say: [missing])
    assert Command(failing).main(["cache=cache", "cluster=inline"]) == 1
    assert "springs: workers cannot be prepared: FileNotFoundError" in capsys.readouterr().err


def test_the_fork_server_starts_before_choices_are_checked(tmp_path, monkeypatch):
    """It starts to import modules before choices are checked, and only if workers may follow."""
    monkeypatch.chdir(tmp_path)
    Path("there.zarr").mkdir()
    order = []

    def check(choices):
        order.append("check")
        raise ConfigurationError("not now")

    monkeypatch.setattr(line, "start_fork_server", lambda modules: order.append("toys" in modules))
    for word in ("store=there.zarr", "dry_run=true", "cluster=inline", "store=new.zarr"):
        Command(replace(SPRINGS, check=check)).main(["cache=cache", word])
    assert order == [*["check"] * 3, True, "check"]


def test_failed_cells_are_reported_with_exit_status_1(start, capsys):
    assert start("store=s.zarr", "spring.limit=1.5") == 1
    output = capsys.readouterr().err
    assert "springs: failed: period stiffness=4 mass=1: ValueError: too [stiff]" in output
    last = "springs: 1 cell failed: period stiffness=4 mass=1 (ValueError: too [stiff]); tracebacks"
    assert output.splitlines()[-1].startswith(last)
    text = Path("s-failures.log").read_text(encoding="utf-8")
    assert text.startswith("period stiffness=4 mass=1\n    ValueError: too [stiff]\n")
    assert "        limit = 1.5\n" in text and "        solver = {'rate': 2.0}\n" in text
    assert 'raise ValueError("too [stiff]")' in text and "toys.py" in text
    assert start("store=s.zarr", "spring.limit=1.5") == 1 and CALLS["period"] == 1


REFUSED = yaml.safe_load(Path(__file__).with_name("refused.yaml").read_text())["command"]


@pytest.mark.parametrize("argument", REFUSED)
def test_invalid_arguments_exit_with_2_and_one_line(start, tmp_path, capsys, argument):
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("mine")
    before = files(tmp_path)
    assert start(*argument.split(" ")) == 2  # split as a shell does
    output = capsys.readouterr()
    (sentence,) = output.err.splitlines()
    assert output.out == "" and sentence.startswith("springs: ") and REFUSED[argument] in sentence
    assert files(tmp_path) == before and not CALLS


def test_a_store_of_another_experiment_is_refused(start, tmp_path, capsys):
    assert start("store=s.zarr") == 0
    pendulums = replace(SPRINGS, name="pendulums", title="Pendulums")
    before = files(tmp_path)
    capsys.readouterr()
    assert Command(pendulums).main(["cache=cache", "cluster=inline", "store=s.zarr"]) == 2
    sentence = "which holds 'Springs'; it must be a new path, or a store of pendulums\n"
    assert capsys.readouterr().err.endswith(sentence)
    assert files(tmp_path) == before


def test_dry_run_counts_cells_and_writes_nothing(start, tmp_path, capsys):
    def dry_run(*overrides):
        """Return the rows of the table, by stage, and the sentence after it."""
        assert start("store=s.zarr", "dry_run=true", *overrides) == 0
        _, *rows, sentence = capsys.readouterr().out.splitlines()
        return dict(row.split(maxsplit=1) for row in rows), sentence

    rows, sentence = dry_run()
    assert list(tmp_path.iterdir()) == []
    assert sentence == "50 calls to run; new results unknown; time on one core unknown"
    counts = {name: row.split() for name, row in rows.items()}
    cells = {"period": 4, "energy": 6, "noisy": 24, "trace": 24, "answers": 16}
    assert counts == {name: [str(n), "0", str(n)] for name, n in cells.items()}
    assert start("store=s.zarr") == 0
    before = files(tmp_path)
    capsys.readouterr()
    assert dry_run()[1] == "nothing to compute: all cells are in the store"
    rows, sentence = dry_run("measured.rule=[max,mean,min]")
    assert rows["answers"].split() == ["24", "16", "8"]
    assert sentence.startswith("4 calls to run; new results 0.00")
    # Without the cache, a store that lacks a cell cannot be reused.
    rows, _ = dry_run("cache=new", "measured.rule=[max,mean,min]")
    assert {rows[name].split()[2] for name in ("answers", "noisy", "trace")} == {"24"}
    assert start("dry_run=true") == 0  # no store is given
    assert start("store=s.zarr", "dry_run=true", "spring.mass=9") == 2
    assert files(tmp_path) == before and not (tmp_path / "new").exists()


# processes ----------------------------------------------------------------------------------------

PRINTED = {"full": ("full", "pipe"), "pipe": ("pipe", "closed"), "ascii": ("ascii", "ascii")}
SIGNALS = {signal.SIGTERM: "stopped by SIGTERM", signal.SIGINT: "interrupted"}


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """Return folder and status of commands with failing or ASCII output, or stopped by signals."""
    folders = {name: tmp_path_factory.mktemp(str(name)) for name in (*PRINTED, *SIGNALS)}
    cases = []
    for name, output in PRINTED.items():
        store = "store='s [bold] ä.zarr'" if name == "ascii" else "store=s.zarr"
        cases.append({"output": output, "arguments": [store], "folder": str(folders[name])})
    stiff = "{start: 1, stop: 200, step: 1}"  # stopped long before its end
    slow = ["store=s.zarr", "measured.pause=0.02", f"spring.stiffness={stiff}"]
    for number in SIGNALS:
        case = {"output": ("utf-8", "utf-8"), "arguments": slow, "folder": str(folders[number])}
        cases.append(case | {"signal": number})
    done = statuses("processes", "main", cases)
    return dict(zip(folders, zip(folders.values(), done, strict=True), strict=True))


def test_output_errors_lose_no_results(ended):
    statuses = {name: ended[name][1] for name in PRINTED}
    assert statuses == {"full": 1, "pipe": 0, "ascii": 0}  # a closed pipe is no error
    stores = {name: next(ended[name][0].glob("*.zarr")) for name in PRINTED}
    assert stores["ascii"].name == "s [bold] ä.zarr"
    for name in PRINTED:
        assert files(stores[name]) == files(stores["full"]) and (stores[name] / "tables").exists()
    out, error = ((ended["ascii"][0] / stream).read_text() for stream in ("out", "err"))
    assert "s [bold] \\xe4.zarr [/bold]\\xe4" in out and "cells computed" in error
    assert "Traceback" not in out + error


@pytest.mark.parametrize("number", SIGNALS)
def test_stopped_command_reports_the_signal(ended, number):
    folder, status = ended[number]
    assert status == 128 + number
    output = (folder / "err").read_text()
    last = f"springs: {SIGNALS[number]}; the same command resumes the sweep"
    assert output.splitlines()[-1] == last and "Traceback" not in output
    assert not (folder / "s.zarr").exists()
    assert not (folder / ".s.zarr.lock").exists()
