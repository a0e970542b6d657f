"""The commands print their version without slow imports, and help in 80 columns."""

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
def test_version_matches_the_distribution_without_heavy_imports(name):
    program = f"""
import atexit, sys
atexit.register(lambda: print(*sys.modules))
from {COMMANDS[name]} import main
main()
"""
    line, modules = python("-c", program, "--version").stdout.splitlines()
    assert line == f"{name} {version('ncti-sweep')}"
    assert not HEAVY & set(modules.split())


def test_help_has_every_experiment_and_the_main_keys_in_80_columns(capsys):
    assert ran("--help") == 0
    captured = capsys.readouterr()
    assert captured.out == f"{usage(EXPERIMENT)}\n" and captured.err == ""
    assert max(map(cell_len, captured.out.splitlines())) < 80
    words = " ".join(captured.out.split())
    experiments = dict(descriptions(conf_folder(), "experiment"))
    assert set(experiments) == {path.stem for path in (conf_folder() / "experiment").iterdir()}
    for name, description in experiments.items():
        assert description.endswith(".") and f" {name} {description}" in words
    settings = main_settings(EXPERIMENT)
    keys = {setting.key for setting in settings}
    assert {"sensor", "grid.aspect", "classifier.name", "store", "cache"} <= keys
    assert {"seed", "dry_run", "cluster.kind", "grid.zip"} <= keys
    for setting in settings:
        assert f" {setting.key} {setting.label}" in words
