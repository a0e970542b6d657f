"""Libraries that take long to import wait until something needs them."""

import pkgutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

import ncti
from ncti import classify

ROOT = Path(__file__).resolve().parent.parent


def loaded_after(statement: str) -> set[str]:
    """Names of all modules that a new process has loaded after a statement."""
    done = subprocess.run(
        [sys.executable, "-c", f"{statement}\nimport sys\nprint(*sys.modules)"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.split())


def test_the_library_alone_loads_nothing_but_itself():
    found = loaded_after("import ncti")
    assert {name for name in found if name.startswith("ncti")} == {"ncti"}
    assert not found & {"numpy", "scipy", "sklearn", "trimesh", "xarray"}


@pytest.mark.parametrize("name", ncti.__all__)
def test_every_package_is_reachable_from_the_library(name):
    assert f"ncti.{name}" in loaded_after(f"import ncti\nncti.{name}.__all__")


def test_the_library_lists_its_packages():
    assert ncti.__all__ == [one.name for one in pkgutil.iter_modules(ncti.__path__) if one.ispkg]
    assert {*ncti.__all__, "__version__"} <= {*dir(ncti)}


def test_the_library_has_the_version_of_its_distribution():
    assert ncti.__version__ == metadata.version("ncti-sweep")


@pytest.mark.parametrize("package", [ncti, classify])
def test_what_a_package_lacks_is_named(package):
    with pytest.raises(AttributeError, match=f"'{package.__name__}' has no attribute 'no_such'"):
        package.no_such  # noqa: B018
    assert not hasattr(package, "no_such")


def test_every_public_name_of_the_classifiers_is_found():
    assert set(classify.__all__) <= {*dir(classify)}
    assert [getattr(classify, name).__name__ for name in classify.__all__] == classify.__all__


@pytest.mark.parametrize(("name", "needs_it"), [("cluster", False), ("GaussianTemplates", True)])
def test_a_classifier_loads_scikit_learn_only_if_it_needs_it(name, needs_it):
    assert ("sklearn" in loaded_after(f"from ncti.classify import {name}")) is needs_it


def test_the_command_line_loads_no_library_that_takes_long():
    found = loaded_after("from sweeps.app import command\ncommand()")
    assert "sweeps.experiment" in found
    assert not found & {
        *("dask", "distributed", "matplotlib", "networkx", "numba", "pandas", "pyrender"),
        *("scipy", "skimage", "sklearn", "trimesh", "xarray", "zarr"),
    }
