"""The command line: its exit statuses and messages, and that failing output loses no results."""

import errno
import re
import signal
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
import yaml
from forked import statuses
from small_stores import files
from toys import CALLS, SPRINGS, go

from sweeps.engine.command import line
from sweeps.engine.command.line import Command
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


def test_without_a_store_it_is_in_the_current_folder_and_hydra_makes_none(start, tmp_path):
    assert start() == 0
    assert {path.name for path in tmp_path.iterdir()} == {"cache", "sweep.zarr"}
    assert start() == 0 and not CALLS
    assert start("hydra.run.dir=asked", "spring.mass=9") == 0
    assert (tmp_path / "asked" / "sweep.zarr").is_dir()
    assert start("hydra.run.dir=asked", "spring.mass=nan") == 2


def test_settings_are_listed_without_a_broken_word_and_found_by_one(capsys):
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


def test_a_sweep_ends_with_its_tables_its_store_and_the_next_command(start, capsys):
    assert start("store=a b.zarr") == 0
    for _ in range(2):  # the second run computes nothing
        words, table, end = capsys.readouterr().out.split("\n\n")
        assert words.startswith("Best ") and words.endswith(".")
        assert "best" in table.split("\n")[0] and "[kg]" in table and len(table.split("\n")) > 2
        assert end == "store   a b.zarr\nnext    ncti-report 'a b.zarr'\n"
        assert start("store=a b.zarr") == 0


def test_a_whole_sweep_and_the_same_again(start, tmp_path, capsys):
    reported = []
    command = Command(SPRINGS, lambda path, choices, finished: reported.append((path, finished)))
    arguments = [
        "cache=cache",
        "cluster=inline",
        "store=s.zarr",
        "spring.mass={start:1,stop:2,step:1}",
    ]
    assert command.main(arguments) == 0
    go(tmp_path / "t.zarr")
    assert files(tmp_path / "s.zarr") == files(tmp_path / "t.zarr")
    assert [path.name for path, _ in reported] == ["s.zarr"]
    output = capsys.readouterr()
    assert (
        output.out == "" and "springs: 74 cells to compute, 0 reused from the cache" in output.err
    )
    CALLS.clear()
    assert command.main(arguments) == 0 and not CALLS and len(reported) == 2
    assert "springs: 0 cells to compute, 74 are in the store" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("number", "verb", "status"),
    [
        (errno.EACCES, "access", 2),
        (errno.EMFILE, "access", 1),
        (errno.EIO, "access", 1),
        (errno.ENOSPC, "write", 1),
        (UNREACHABLE, "reach", 1),
    ],
)
def test_an_error_of_a_disk_is_one_sentence(start, capsys, monkeypatch, number, verb, status):
    def fail(objects, under=""):
        raise OSError(number, "no luck", "cache/cells")

    monkeypatch.setattr(Objects, "list_objects", fail)
    assert start("--cache") == status
    assert capsys.readouterr().err == f"springs: cannot {verb} 'cache/cells': no luck\n"


@pytest.mark.parametrize("kind", ["inline", "local"])
def test_workers_prepare_before_the_first_cell(kind, capsys, tmp_path, monkeypatch):
    """Each of two functions is called once; the message about them precedes the last line."""
    monkeypatch.chdir(tmp_path)

    def prepare(choices, say):
        say("compiling the loops")
        return [partial(Path.touch, tmp_path / name, exist_ok=False) for name in "ab"]

    compiling = replace(SPRINGS, prepare=prepare)
    assert Command(compiling).main(["cache=cache", f"cluster={kind}"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines.index("springs: compiling the loops") < len(lines) - 1 and "computed" in lines[-1]
    assert Path("a").exists() and Path("b").exists()


def test_a_preparation_that_fails_is_one_sentence(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    missing = partial(Path.unlink, tmp_path / "loops")
    failing = replace(SPRINGS, prepare=lambda choices, say: [missing])
    assert Command(failing).main(["cache=cache", "cluster=inline"]) == 1
    assert "springs: workers cannot be prepared: FileNotFoundError" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "starts"),
    [
        (["store=new.zarr"], True),
        (["store=there.zarr"], False),
        (["store=new.zarr", "dry_run=true"], False),
        (["store=new.zarr", "cluster=inline"], False),
        (["store=new.zarr", "spring.mass=-1"], False),
    ],
)
def test_the_fork_server_starts_before_choices_are_checked(words, starts, tmp_path, monkeypatch):
    """It starts to import modules before choices are checked, and only if workers may follow."""
    monkeypatch.chdir(tmp_path)
    Path("there.zarr").mkdir()
    order = []
    monkeypatch.setattr(line, "start_fork_server", lambda modules: order.append("toys" in modules))
    checked = replace(SPRINGS, check=lambda choices: order.append("check") or choices)
    Command(checked).main(["cache=cache", *words])
    assert order[:2] == [True, "check"] if starts else True not in order


def test_cells_that_fail_are_named_and_exit_with_1(start, capsys):
    assert start("store=s.zarr", "spring.limit=1.5") == 1
    output = capsys.readouterr().err
    assert "springs: failed: period stiffness=4 mass=1: ValueError: too [stiff]" in output
    assert output.splitlines()[-1].startswith(
        "springs: 1 cell failed: period stiffness=4 mass=1 (ValueError: too [stiff]); tracebacks "
    )
    text = Path("s-failures.log").read_text(encoding="utf-8")
    assert text.startswith("period stiffness=4 mass=1\n    ValueError: too [stiff]\n")
    assert "        limit = 1.5\n" in text and "        solver = {'rate': 2.0}\n" in text
    assert 'raise ValueError("too [stiff]")' in text and "toys.py" in text
    assert start("store=s.zarr", "spring.limit=1.5") == 1 and CALLS["period"] == 1


REFUSED = yaml.safe_load(Path(__file__).with_name("refused.yaml").read_text())["command"]


@pytest.mark.parametrize("argument", REFUSED)
def test_what_is_wrong_exits_with_2_and_one_sentence(start, tmp_path, capsys, argument):
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
    assert capsys.readouterr().err == (
        f"pendulums: store is {str(tmp_path / 's.zarr')!r}, which holds {SPRINGS.title!r}; it must "
        "be a new path, or a store of pendulums\n"
    )
    assert start("store=s.zarr", "spring.mass=9") == 2
    assert "give spring.mass=[1,2,9] to have both, or another store" in capsys.readouterr().err
    assert files(tmp_path) == before


def test_a_dry_run_writes_nothing_and_is_right(start, tmp_path, capsys):
    overrides = ("store=s.zarr", "dry_run=true")
    assert start(*overrides) == 0
    assert files(tmp_path) == {} and list(tmp_path.iterdir()) == []
    output = capsys.readouterr().out.split("\n")
    assert output[-2] == "50 calls to run; new results unknown; time on one core unknown"
    rows = {row.split()[0]: row.split()[1:] for row in output[1:-2]}
    assert rows == {
        "period": ["4", "0", "4"],
        "energy": ["6", "0", "6"],
        "noisy": ["24", "0", "24"],
        "trace": ["24", "0", "24"],
        "answers": ["16", "0", "16"],
    }
    assert start("store=s.zarr") == 0
    before = files(tmp_path)
    capsys.readouterr()
    assert start(*overrides) == 0
    assert capsys.readouterr().out.endswith("nothing to compute: all cells are in the store\n")
    assert start(*overrides, "measured.rule=[max,mean,min]") == 0
    output = capsys.readouterr().out
    assert (
        re.search(r"answers +24 +16 +8\n", output) and "4 calls to run; new results 0.00" in output
    )
    # Without the cache, a store that lacks a cell cannot be reused.
    assert start(*overrides, "cache=new", "measured.rule=[max,mean,min]") == 0
    rows = [row.split() for row in capsys.readouterr().out.splitlines()]
    assert ["answers", "24", "0", "24"] in rows and ["noisy", "24", "0", "24"] in rows
    assert ["trace", "24", "0", "24"] in rows
    assert start("dry_run=true") == 0  # no store is given
    assert start(*overrides, "spring.mass=9") == 2
    assert files(tmp_path) == before and not (tmp_path / "new").exists()


# processes ----------------------------------------------------------------------------------------

PRINTED = {
    "full": ("full", "pipe"),
    "pipe": ("pipe", "full"),
    "closed": ("closed", "closed"),
    "ascii": ("ascii", "ascii"),
}
SIGNALS = {
    signal.SIGTERM: "stopped by SIGTERM",
    signal.SIGHUP: "stopped by SIGHUP",
    signal.SIGINT: "interrupted",
}
STIFF = list(range(1, 201))  # takes some seconds: the sweep is stopped long before its end


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """Return folder and status of commands with failing or ASCII output, or stopped by signals."""
    folders = {name: tmp_path_factory.mktemp(str(name)) for name in (*PRINTED, *SIGNALS)}
    cases = []
    for name, output in PRINTED.items():
        store = "store='s [bold] ä.zarr'" if name == "ascii" else "store=s.zarr"
        cases.append({"output": output, "arguments": [store], "folder": str(folders[name])})
    slow = ["store=s.zarr", "measured.pause=0.02", f"spring.stiffness={STIFF}".replace(" ", "")]
    for number in SIGNALS:
        case = {"output": ("utf-8", "utf-8"), "arguments": slow, "folder": str(folders[number])}
        cases.append(case | {"signal": number})
    done = statuses("processes", "main", cases)
    return dict(zip(folders, zip(folders.values(), done, strict=True), strict=True))


def test_printing_costs_no_results(ended):
    statuses = {name: ended[name][1] for name in PRINTED}
    assert statuses == dict.fromkeys(PRINTED, 0) | {"full": 1}  # a closed pipe is no error
    stores = {name: next(ended[name][0].glob("*.zarr")) for name in PRINTED}
    assert stores["ascii"].name == "s [bold] ä.zarr"
    for name in PRINTED:
        assert files(stores[name]) == files(stores["closed"]) and (stores[name] / "tables").exists()
    out, error = ((ended["ascii"][0] / stream).read_text() for stream in ("out", "err"))
    assert "s [bold] \\xe4.zarr [/bold]\\xe4" in out and "cells computed" in error
    assert "Traceback" not in out + error


@pytest.mark.parametrize("number", SIGNALS)
def test_a_command_that_is_stopped_says_so_and_goes_on(ended, number):
    folder, status = ended[number]
    assert status == 128 + number
    output = (folder / "err").read_text()
    last = f"springs: {SIGNALS[number]}; the same command resumes the sweep"
    assert output.splitlines()[-1] == last and "Traceback" not in output
    assert not (folder / "s.zarr").exists()
    assert not [path for path in folder.iterdir() if path.name.endswith((".partial", ".lock"))]
    if number == signal.SIGTERM:
        slow = {"measured__pause": 0.02, "spring__stiffness": STIFF}
        finished = go(folder / "s.zarr", folder / "cache", **slow)
        assert any(progress.reused for progress in finished.progress.values())
