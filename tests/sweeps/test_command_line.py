"""What the commands say of themselves: help, version, completion and their first words."""

import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from commands import chosen, ran
from rich.cells import cell_len
from stores import contents, printed

from sweeps.app import command
from sweeps.engine.usage import descriptions, main_settings, usage
from sweeps.experiment import EXPERIMENT, conf_folder
from sweeps.stages import views

ROOT = Path(__file__).resolve().parents[2]
HEAVY = {"numpy", "hydra", "rich", "dask", "xarray", "zarr", "numba", "matplotlib", "scipy"}
COMMANDS = {"ncti-sweep": "sweeps.app", "ncti-report": "sweeps.report.command"}


def python(program, *arguments, **environment):
    """What a program in a process of its own prints."""
    return subprocess.run(
        [sys.executable, "-c", program, *arguments],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


def test_nothing_heavy_is_imported_before_the_first_words():
    program = """
import sys
from sweeps import app
def say(sentence):
    print(sentence, *sys.modules, sep="\\n")
    sys.exit()
app._say = say
app.main()
"""
    first, *modules = python(program, "+experiment=smoke").splitlines()
    assert first == "reading the configuration"
    assert not HEAVY & set(modules)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_version_is_that_of_the_distribution_and_needs_nothing_heavy(name):
    program = f"""
import atexit, sys
atexit.register(lambda: print(*sys.modules))
from {COMMANDS[name]} import main
main()
"""
    first, modules = python(program, "--version").splitlines()
    assert first == f"{name} {version('ncti-sweep')}"
    assert not HEAVY & set(modules.split())


def test_help_has_every_experiment_and_the_main_keys_in_80_columns(capsys):
    assert ran("--help") == 0
    said = capsys.readouterr()
    assert said.out == f"{usage(EXPERIMENT)}\n" and said.err == ""
    assert max(map(cell_len, said.out.splitlines())) < 80
    words = " ".join(said.out.split())
    experiments = dict(descriptions(conf_folder(), "experiment"))
    assert set(experiments) == {path.stem for path in (conf_folder() / "experiment").iterdir()}
    for name, about in experiments.items():
        assert about.endswith(".") and f" {name} {about}" in words
    settings = main_settings(EXPERIMENT)
    keys = {one.key for one in settings}
    assert {"sensor", "grid.aspect", "render.engine", "classifier.name", "store", "cache"} <= keys
    assert {"seed", "dry_run", "cluster.kind", "grid.zip"} <= keys
    for one in settings:
        assert f" {one.key} {one.label}" in words


COMPLETED = {
    "ncti-sweep +experiment=sm": ["+experiment=smoke"],
    "ncti-sweep classifier=": [
        *("classifier=acn", "classifier=all", "classifier=correlation", "classifier=fusion"),
        *("classifier=likelihood", "classifier=mnn"),
    ],
    "ncti-sweep grid.ra": ["grid.range="],
    "ncti-sweep +experiment=paper ladar.re": ["ladar.receiver=", "ladar.reflectance="],
}


@pytest.mark.parametrize("line", COMPLETED)
def test_the_shell_completes_experiments_groups_and_keys(line, capsys, monkeypatch):
    monkeypatch.setenv("COMP_LINE", line)
    monkeypatch.setenv("COMP_POINT", str(len(line)))
    assert ran("-sc", "query=bash") == 0
    said = capsys.readouterr()
    assert sorted(said.out.split()) == COMPLETED[line] and said.err == ""


def test_completion_is_installed_for_the_name_of_the_command(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/somewhere/bin/ncti-sweep"])
    assert command().main(["-sc", "install=bash"]) == 0
    assert "complete -o nospace -o default -F hydra_bash_completion ncti-sweep" in (
        capsys.readouterr().out
    )


def test_a_scan_that_fails_everywhere_is_a_store_that_can_be_reported(
    folder, results, capsys, monkeypatch
):
    def broken(*given, **more):
        raise RuntimeError("out of [time]")

    monkeypatch.setattr("ncti.search.schedule", broken)
    small = ("grid.ship=[duncan,texas]", "grid.aspect=[0,45,90]", "grid.frame_count=[2,4]")
    scan = ("grid.range=50", "grid.replicate=1", "scan.known_views=4", "scan.lost=0.06")
    coarse = ("render.pixel=1", "render.samples=0", "render.engine=embree")
    given = (*small, *scan, *coarse, "store=s.zarr", f"cache={results}")
    assert ran("+experiment=scan", *given) == 1
    said = capsys.readouterr()
    assert "scan_found frame_count=2 (RuntimeError: out of [time])" in said.err.splitlines()[-1]
    assert "cannot" not in said.err and "Traceback" not in said.err
    assert "failed  2 cells: the tables cover the others" in said.out
    assert "failed  2 cells" in printed(folder / "s.zarr", 80)
    assert set(contents(folder / "s-tables")) == {"scan.csv", "stages.csv"}


def test_the_folder_of_the_cache_is_not_left_in_the_environment(tmp_path, monkeypatch):
    """A later sweep of the same process has the cache that it asks for."""
    monkeypatch.delenv("NCTI_CACHE", raising=False)
    for one in (views.read_mesh, views.description):  # other tests may have read the ship
        one.cache_clear()
    before = dict(os.environ)
    chosen("cache=mine", "grid.ship=duncan")
    assert ran("grid.ship=duncan", "store=s.zarr", "cache=mine", "dry_run=true") == 0
    assert dict(os.environ) == before
    assert any((tmp_path / "mine" / "meshes").iterdir())
