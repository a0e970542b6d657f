"""Installed packages add modules to the command by entry points, as the studies do."""

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from commands import opened

from sweeps import Command
from sweeps.engine.declare.errors import ConfigurationError, DeclarationError
from sweeps.engine.declare.stage import Stage
from sweeps.experiment import (
    CORE,
    INSTALLED,
    MODULES,
    assemble,
    load_installed_modules,
    stages_of,
)

SOUNDER = '''
"""A depth sounder."""

from pathlib import Path

from sweeps import Group, Output, Settings, number
from sweeps.stages.views import Grid, uses_sensor

SENSOR = "sounder"
CONF = Path(__file__).with_name("sounder_conf")


class Sounder(Settings, key="sounder"):
    """The sounder."""

    offset = number(1.0, 0, 10, unit="m", label="depth of the sounder", role="dimension")


DEPTHS = Group("depths", uses_sensor(SENSOR), uses=(Grid, Sounder))


@DEPTHS.stage(Output("depth", label="depth", unit="m"))
def sounded(aspect, offset):
    """Return a depth [m]."""
    return aspect + offset


@DEPTHS.stage(Output("unlisted", label="a stage that the module does not list"))
def unlisted(aspect):
    """Return nothing of use."""
    return aspect


STAGES = (sounded,)
'''


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return a function that puts a package of one module on this process's path, by its source."""

    def install(source):
        site = tmp_path / "site"
        metadata = site / "sounder-1.0.dist-info"
        (site / "sounder_conf" / "experiment").mkdir(parents=True)
        metadata.mkdir()
        (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: sounder\nVersion: 1.0\n")
        (metadata / "entry_points.txt").write_text("[sweeps.modules]\nsounder = sounder\n")
        (site / "sounder.py").write_text(source)
        (site / "sounder_conf" / "experiment" / "sounding.yaml").write_text(
            "# @package _global_\n# Depths at two aspects.\n"
            "sensor: sounder\ngrid:\n  ship: duncan\n  aspect: [0, 90]\n"
        )
        monkeypatch.syspath_prepend(str(site))
        monkeypatch.delitem(sys.modules, "sounder", raising=False)
        return site

    return install


def test_installed_package_adds_its_module_and_experiment(package, folder, capsys):
    package(SOUNDER)
    modules = (*CORE, *load_installed_modules())
    added = [module.__name__ for module in modules if module not in (*CORE, *INSTALLED)]
    assert added == ["sounder"]
    command = Command(assemble(*modules, code=("sounder",)))
    assert command.main(["--help"]) == 0
    assert "sounding          Depths at two aspects." in capsys.readouterr().out
    arguments = ["+experiment=sounding", "sounder.offset=[1,2]", "store=s.zarr", "cache=cache"]
    assert command.main([*arguments, "cluster=inline"]) == 0, capsys.readouterr().err
    depths = opened(folder / "s.zarr", "depths")
    assert set(depths.data_vars) == {"depth"}
    depth = depths.depth.transpose("aspect", "offset")
    np.testing.assert_array_equal(depth, [[1, 2], [91, 92]])


@pytest.mark.parametrize(
    ("attribute", "key"),
    [
        ("NAME", "classifier.name"),
        ("SENSOR", "sensor"),
        ("ENTRIES", "benchmark.classifier"),
    ],
)
def test_settings_accept_words_declared_by_added_modules(attribute, key):
    words = ("first", "second") if attribute == "ENTRIES" else "first"
    setting = assemble(*MODULES, SimpleNamespace(**{attribute: words})).by_key[key]
    assert setting.values(["first"]) in (("first",), (("first",),))
    with pytest.raises(ConfigurationError, match="'third', but must be"):
        setting.values(["third"])


def test_unimportable_module_is_reported(package):
    site = package("import no_such_library")
    with pytest.raises(DeclarationError, match=r"sounder has the entry point sounder of sweeps"):
        load_installed_modules()
    code = f"import sys; sys.path.insert(0, {str(site)!r}); from sweeps.app import main; main()"
    process = subprocess.run(
        [sys.executable, "-c", code, "--help"], capture_output=True, text=True, timeout=120
    )
    assert process.returncode == 2
    assert process.stderr.count("\n") == 1 and "No module named 'no_such_library'" in process.stderr


@pytest.mark.parametrize("module", [*CORE, *INSTALLED], ids=lambda module: module.__name__)
def test_modules_of_the_project_list_every_stage_they_declare(module):
    values = [item for value in vars(module).values() for item in flat(value)]
    declared = {
        item for item in values if isinstance(item, Stage) and of_module(item) == module.__name__
    }
    assert declared <= {*stages_of([module])}


def flat(value):
    return value if isinstance(value, tuple) else (value,)


def of_module(stage):
    return getattr(stage.function, "__module__", "")
