"""The command line: what it exits with, what it says, and that printing costs no results."""

import contextlib
import json
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import pytest
from small_stores import files
from toys import CALLS, SPRINGS, go

from sweeps.engine import command as commands
from sweeps.engine.command import Command
from sweeps.engine.errors import SweepIncomplete
from sweeps.engine.failures import FailureLog
from sweeps.engine.process import show
from sweeps.engine.results import CellIndex
from sweeps.engine.watching import summary, watching


@pytest.fixture
def start(tmp_path, monkeypatch):
    """Run a command line in a folder of its own; its exit status."""
    monkeypatch.chdir(tmp_path)

    def start(*arguments):
        CALLS.clear()
        return Command(SPRINGS).main(["cache=cache", "cluster=inline", *arguments])

    return start


def listing(folder):
    """All files of a folder with their contents."""
    return files(folder)


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
    said = capsys.readouterr()
    assert said.out == "" and "springs: 74 cells to compute, 0 reused from the cache" in said.err
    CALLS.clear()
    assert command.main(arguments) == 0 and not CALLS and len(reported) == 2
    assert "springs: 0 cells to compute, 74 reused from the cache" in capsys.readouterr().err


def test_cells_that_fail_are_named_and_exit_with_1(start, capsys):
    assert start("store=s.zarr", "spring.limit=1.5") == 1
    said = capsys.readouterr().err
    assert "springs: failed: period stiffness=4 mass=1: ValueError: too [stiff]" in said
    assert said.splitlines()[-1].startswith(
        "springs: 1 cell failed: period stiffness=4 mass=1 (ValueError: too [stiff]); tracebacks "
    )
    assert start("store=s.zarr", "spring.limit=1.5") == 1 and CALLS["period"] == 1


def test_a_report_that_is_not_complete_exits_with_1(start, tmp_path, capsys):
    def report(path, choices, finished):
        raise SweepIncomplete("'mine.csv' stays as it is")

    given = ["cache=cache", "cluster=inline", "store=s.zarr"]
    assert Command(SPRINGS, report).main(given) == 1
    assert capsys.readouterr().err.splitlines()[-1] == "springs: 'mine.csv' stays as it is"
    go(tmp_path / "t.zarr")
    assert files(tmp_path / "s.zarr") == files(tmp_path / "t.zarr")
    assert Command(SPRINGS, report).main([*given[:2], "store=u.zarr", "spring.limit=1.5"]) == 1
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("springs: 'mine.csv' stays as it is; 1 cell failed: period ")


REFUSED = {
    "spring.nothing=1": "spring.nothing is not a key of the configuration; spring has stiffness, "
    "mass, limit, reference",
    "+spring.nothing=1": "spring.nothing is not a key of the configuration; spring has stiffness, "
    "mass, limit, reference",
    "nothing=1": "nothing is not a key of the configuration; it has spring, measured, seed, ",
    "spring.mass.deep=1": "spring.mass",
    "spring=3": "spring is 3, but must hold stiffness, mass, limit, reference",
    "spring=[1]": "spring",
    "spring.mass=heavy": "spring.mass has 'heavy', but every value must be a finite number at least"
    " 0.1",
    "spring.mass=[1,0]": "spring.mass has 0, but every value must be a finite number at least 0.1",
    "spring.mass=[]": "spring.mass is empty, but must hold at least one value",
    "spring.mass=nan": "spring.mass has nan, but",
    "measured.rule=best": "measured.rule has 'best', but every value must be one of max, mean, min",
    "measured.draw=0": "measured.draw is 0, but must be a whole number from 1 to 1000",
    "spring.reference=3": "spring.reference has 3, but must be one of spring.stiffness",
    "spring.mass=[1,2": "spring.mass=[1,2 cannot be read (",
    "=3": "=3 has no key, but must be KEY=VALUE",
    "cluster=grid": "cluster is 'grid', but must be one of address, inline, local, slurm",
    "cluster=[inline,local]": "cluster is [inline,local], but must be one choice",
    "cluster.workers=2": "cluster.workers is 2, but must be null when cluster.kind is inline",
    "spring.mass=${spring.weight}": "spring.mass is ${spring.weight}, but must refer to keys that "
    "have a value (spring.weight is not a key of the configuration; spring has stiffness, mass, "
    "limit, reference)",
    "spring.mass=[1,${nothing}]": "spring.mass is [1, '${nothing}'], but must refer to keys that "
    "have a value (nothing is not a key of the configuration; it has spring, measured, ",
    "store=${spring.mas}.zarr": "store is ${spring.mas}.zarr, but must refer to keys that have",
    "spring.mass=${spring.mass}": "spring.mass is ${spring.mass}, but must refer to keys that have "
    "a value (Recursive interpolation detected)",
    "spring=null": "spring is null, but must hold stiffness, mass, limit, reference",
    "spring.mass=null": "spring.mass has null, but every value must be",
    "measured.draw=null": "measured.draw is null, but must be a whole number",
    "store=s3://bucket/s.zarr": "store is 's3://bucket/s.zarr', but must be a folder on a file "
    "system: URLs are not supported",
    "store=file:///tmp/s.zarr": "URLs are not supported",
    "cache=gs://bucket/cache": "cache is 'gs://bucket/cache', but must be a folder",
    "store=notes": "store is 'notes', which exists but is not a store of a sweep; it must be a new "
    "path or such a store",
    "store=[a,b]": "store has 2 values, but must have one: it sets where or how to run",
    "dry_run=maybe": "dry_run has 'maybe', but every value must be one of true, false",
}


def test_a_check_that_takes_a_while_is_told_meanwhile(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(commands, "PATIENCE", 0.01)
    told = threading.Event()
    sentences = []

    def say(name, sentence):
        sentences.append(sentence)
        told.set()

    def slow(choices):
        assert told.wait(10)
        return choices

    monkeypatch.setattr(commands, "say", say)
    command = Command(replace(SPRINGS, check=slow, checking="building springs"))
    assert command.main(["cluster=inline", "cache=cache", "store=s.zarr", "dry_run=true"]) == 0
    assert sentences[0] == "building springs"


@pytest.mark.parametrize("argument", REFUSED)
def test_what_is_wrong_exits_with_2_and_one_sentence(start, tmp_path, capsys, argument):
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("mine")
    before = listing(tmp_path)
    assert start(argument) == 2
    said = capsys.readouterr()
    (sentence,) = said.err.splitlines()
    assert said.out == "" and sentence.startswith("springs: ") and REFUSED[argument] in sentence
    assert listing(tmp_path) == before and not CALLS


def test_a_store_of_another_experiment_is_refused(start, tmp_path, capsys):
    assert start("store=s.zarr") == 0
    other = replace(SPRINGS, name="pendulums", title="Pendulums")
    before = listing(tmp_path)
    capsys.readouterr()
    assert Command(other).main(["cache=cache", "cluster=inline", "store=s.zarr"]) == 2
    assert capsys.readouterr().err == (
        f"pendulums: store is {str(tmp_path / 's.zarr')!r}, which holds other data; it must be "
        "a new path, or a store of pendulums\n"
    )
    assert start("store=s.zarr", "spring.mass=9") == 2
    assert "give spring.mass=[1,2,9] to have both, or another store" in capsys.readouterr().err
    assert listing(tmp_path) == before


@pytest.mark.parametrize("same", [False, True], ids=["later", "one command"])
def test_reports_are_never_written_into_a_store(start, tmp_path, capsys, same):
    report = Command(SPRINGS, beside=lambda store: [store.with_name(f"{store.stem}-tables")])
    given = ["cache=cache", "cluster=inline", "spring.stiffness=1", "spring.mass=1"]
    if same:
        stores = ["-m", "store=z-tables,z.zarr"]
    else:
        assert report.main([*given, "store=z-tables"]) == 0
        stores = ["store=z.zarr"]
    before = listing(tmp_path)
    capsys.readouterr()
    assert report.main([*given, *stores]) == 2
    (sentence,) = capsys.readouterr().err.splitlines()
    assert sentence.startswith("springs: store is 'z.zarr', whose report would be written into")
    assert listing(tmp_path) == before


def test_a_dry_run_writes_nothing_and_is_right(start, tmp_path, capsys):
    asked = ("store=s.zarr", "dry_run=true")
    assert start(*asked) == 0
    assert listing(tmp_path) == {} and list(tmp_path.iterdir()) == []
    said = capsys.readouterr().out.split("\n")
    assert said[-2] == "50 calls to run; new results unknown; time on one core unknown"
    rows = {row.split()[0]: row.split()[1:] for row in said[1:-2]}
    assert rows == {
        "period": ["4", "0", "4"],
        "energy": ["6", "0", "6"],
        "noisy": ["24", "0", "24"],
        "trace": ["24", "0", "24"],
        "answers": ["16", "0", "16"],
    }
    assert start("store=s.zarr") == 0
    before = listing(tmp_path)
    capsys.readouterr()
    assert start(*asked) == 0
    assert capsys.readouterr().out.endswith(
        "nothing to compute: all cells are in the cache or the store\n"
    )
    assert start(*asked, "measured.rule=[max,mean,min]") == 0
    said = capsys.readouterr().out
    assert re.search(r"answers +24 +16 +8\n", said) and "4 calls to run; new results 0.00" in said
    # Without the cache, what the store has counts; that is what a run would find.
    assert start(*asked, "cache=new", "measured.rule=[max,mean,min]") == 0
    rows = [row.split() for row in capsys.readouterr().out.splitlines()]
    assert ["answers", "24", "16", "8"] in rows and ["noisy", "24", "24", "0"] in rows
    assert ["trace", "24", "24", "0"] in rows
    assert start("dry_run=true") == 0  # without a store
    assert start(*asked, "spring.mass=9") == 2
    assert listing(tmp_path) == before and not (tmp_path / "new").exists()


def test_words_about_it(start, capsys, monkeypatch):
    assert start("--settings") == 0
    assert "| `spring.mass` | [1, 2] | kg | a finite number at least 0.1 | mass |" in (
        capsys.readouterr().out
    )
    assert start("--version") == 0
    assert capsys.readouterr().out == "springs unknown\n"
    assert Command(replace(SPRINGS, name="numpy")).main(["--version"]) == 0
    assert capsys.readouterr().out == f"numpy {metadata.version('numpy')}\n"
    for words in (("--cfg", "job"), ("--cfg", "job", "spring.mass=7")):
        assert start(*words) == 0
        said = capsys.readouterr().out
        assert "mass:" in said and ("mass: 7" in said) == ("spring.mass=7" in words)
    assert not Path("cache").exists() and not Path("outputs").exists()


def test_the_cache_is_described_and_cleared(start, tmp_path, capsys):
    main = Command(SPRINGS).main
    assert main(["--cache", "cache=cache"]) == 0
    assert capsys.readouterr().out == "0 cells, 0.0 MB kept in cache\n"
    assert not (tmp_path / "cache").exists()
    assert start("store=s.zarr") == 0
    (tmp_path / "cache" / "meshes").mkdir()
    capsys.readouterr()
    assert main(["--cache", "cache=cache"]) == 0
    said = capsys.readouterr().out
    assert "noisy                           24 cells" in said and "74 cells, 0.0 MB kept" in said
    assert main(["--cache", "clear", "cache=cache"]) == 0
    assert "74 cells, 0.0 MB removed from cache" in capsys.readouterr().out.replace(
        " in ", " from "
    )
    assert [one.name for one in (tmp_path / "cache").iterdir()] == ["meshes"]
    assert main(["--cache", "cache=cache"]) == 0
    assert capsys.readouterr().out == "0 cells, 0.0 MB kept in cache\n"
    assert start("store=s.zarr") == 0 and not CALLS["noisy"]  # the store has them
    assert main(["--cache", "everything"]) == 2
    assert main(["--cache", "cache=s3://bucket"]) == 2
    assert "URLs are not supported" in capsys.readouterr().err


def test_the_cache_is_kept_small(start, tmp_path):
    assert start("store=s.zarr", "cache_limit=0") == 0
    kept = CellIndex(tmp_path / "cache", print).summary()
    assert sum(one.cells for one in kept) == 74  # of this run
    time.sleep(0.01)
    assert start("store=t.zarr", "cache_limit=0", "seed=1", "spring.mass=7") == 0
    kept = CellIndex(tmp_path / "cache", print).summary()
    assert sum(one.cells for one in kept) == 3 + 3 + 12 + 12 + 8


def test_a_setting_whose_name_begins_as_hydra_does_is_not_lost():
    from sweeps.engine.settings import Settings, count
    from sweeps.engine.stage import Experiment, Output, stage

    class Hydraulics(Settings, key="hydraulics"):
        """Of pipes."""

        pipes = count(1, label="pipes")

    @stage(Output("flow", label="flow"), uses=(Hydraulics,), group="flows")
    def flow(pipes):
        """What flows."""

    command = Command(Experiment("pipes", "Pipes", (Hydraulics,), (flow,)))
    commands.register(command.experiment)
    ((choices, _),) = command.prepare(["hydraulics.pipes=3", "hydra.verbose=true"], several=False)
    assert choices.one(Hydraulics.pipes) == 3


def test_a_terminal_shows_bars_and_what_is_said_as_it_is(tmp_path, monkeypatch):
    reading, writing = pty.openpty()
    parts = []

    def read():
        with contextlib.suppress(OSError):  # nobody writes any more
            while part := os.read(reading, 2**16):
                parts.append(part)

    reader = threading.Thread(target=read)
    reader.start()
    with open(writing, "w", encoding="utf-8") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        with watching("springs", FailureLog(tmp_path)) as watch:
            watch.say("a store [/bold] ä")
            finished = go(tmp_path / "s.zarr", watch=watch, spring__limit=1.5)
        show(summary(finished.progress, finished.seconds), error=True)
    reader.join()
    os.close(reading)
    shown = b"".join(parts).decode()
    assert "a store [/bold] ä" in shown and "failed: period stiffness=4 mass=1" in shown
    assert "74/74" in shown and "69 cells computed, 0 reused, 5 failed" in shown


# processes ----------------------------------------------------------------------------------------

PRINTED = ("full", "pipe", "closed", "ascii")
SIGNALS = {
    signal.SIGTERM: "stopped by SIGTERM",
    signal.SIGHUP: "stopped by SIGHUP",
    signal.SIGINT: "interrupted",
}
STIFF = list(range(1, 61))


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """Folder and exit status of commands whose output goes nowhere, or that are stopped."""
    folders = {name: tmp_path_factory.mktemp(str(name)) for name in (*PRINTED, *SIGNALS)}
    cases = []
    for name in PRINTED:
        store = "store='s [bold] ä.zarr'" if name == "ascii" else "store=s.zarr"
        cases.append({"output": name, "arguments": [store], "folder": str(folders[name])})
    slow = ["store=s.zarr", "measured.pause=0.02", f"spring.stiffness={STIFF}".replace(" ", "")]
    for number in SIGNALS:
        case = {"output": "file", "arguments": slow, "folder": str(folders[number])}
        cases.append(case | {"signal": number})
    here = Path(__file__).parent
    done = subprocess.run(
        [sys.executable, here / "processes.py"],
        env=os.environ | {"PYTHONPATH": f"{here}:{here.parents[1]}"},
        input=json.dumps(cases),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        timeout=120,
    )
    return dict(
        zip(folders, zip(folders.values(), json.loads(done.stdout), strict=True), strict=True)
    )


def test_printing_costs_no_results(ended):
    assert {name: ended[name][1] for name in PRINTED} == dict.fromkeys(PRINTED, 0)
    stores = {name: next(ended[name][0].glob("*.zarr")) for name in PRINTED}
    assert stores["ascii"].name == "s [bold] ä.zarr"
    for name in PRINTED:
        assert files(stores[name]) == files(stores["closed"]) and (stores[name] / "tables").exists()
    out, error = ((ended["ascii"][0] / one).read_text() for one in ("out", "err"))
    assert "s [bold] \\xe4.zarr [/bold]\\xe4" in out and "cells computed" in error
    assert "Traceback" not in out + error


@pytest.mark.parametrize("number", SIGNALS)
def test_a_command_that_is_stopped_says_so_and_goes_on(ended, number):
    folder, status = ended[number]
    assert status == 128 + number
    said = (folder / "err").read_text()
    last = f"springs: {SIGNALS[number]}; the same command resumes the sweep"
    assert said.splitlines()[-1] == last and "Traceback" not in said
    assert not (folder / "s.zarr").exists()
    assert not [one for one in folder.iterdir() if one.name.endswith((".partial", ".lock"))]
    if number == signal.SIGTERM:
        slow = {"measured__pause": 0.02, "spring__stiffness": STIFF}
        finished = go(folder / "s.zarr", folder / "cache", **slow)
        assert finished.progress["period"].reused > 0


@pytest.mark.parametrize("arguments", [[], ["dry_run=true"]])
def test_what_is_swept_is_told_once_before(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    told = Command(replace(SPRINGS, about=lambda choices: ["a spring", "another"]))
    assert told.main(["cache=cache", "cluster=inline", "store=s.zarr", *arguments]) == 0
    lines = capsys.readouterr().err.splitlines()
    place = lines.index(f"{told.name}: a spring")
    assert lines[place + 1] == f"{told.name}: another" and lines.count(lines[place]) == 1
