"""What the commands say of themselves: help, version, completion and their first words."""

from importlib.metadata import version

import pytest
from commands import ran
from rich.cells import cell_len
from running import python

from sweeps.engine.command.usage import descriptions, main_settings, usage
from sweeps.experiment import EXPERIMENT, conf_folder

HEAVY = {"numpy", "hydra", "rich", "dask", "xarray", "zarr", "numba", "matplotlib", "scipy"}
COMMANDS = {"ncti-sweep": "sweeps.app", "ncti-report": "sweeps.report.command"}


@pytest.mark.parametrize("name", COMMANDS)
def test_the_version_is_that_of_the_distribution_and_needs_nothing_heavy(name):
    program = f"""
import atexit, sys
atexit.register(lambda: print(*sys.modules))
from {COMMANDS[name]} import main
main()
"""
    first, modules = python("-c", program, "--version").stdout.splitlines()
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
    assert {"sensor", "grid.aspect", "classifier.name", "store", "cache"} <= keys
    assert {"seed", "dry_run", "cluster.kind", "grid.zip"} <= keys
    for one in settings:
        assert f" {one.key} {one.label}" in words
