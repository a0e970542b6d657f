"""Libraries that take long to import wait until something needs them."""

from importlib import metadata

from running import python

import ncti


def loaded_after(statement: str) -> set[str]:
    """Names of all modules that a new process has loaded after a statement."""
    done = python("-c", f"{statement}\nimport sys\nprint(*sys.modules)")
    return set(done.stdout.split())


def test_the_library_alone_loads_nothing_but_itself():
    found = loaded_after("import ncti")
    assert {name for name in found if name.startswith("ncti")} == {"ncti"}
    assert not found & {"numpy", "scipy", "sklearn", "trimesh", "xarray"}


def test_the_library_has_the_version_of_its_distribution():
    assert ncti.__version__ == metadata.version("ncti-sweep")


def test_the_command_line_loads_no_library_that_takes_long():
    found = loaded_after("from sweeps.app import command\ncommand()")
    assert "sweeps.experiment" in found
    assert not found & {
        *("dask", "distributed", "matplotlib", "networkx", "numba", "pandas", "pyrender"),
        *("scipy", "skimage", "sklearn", "trimesh", "xarray", "zarr"),
    }
