"""Slow libraries are imported only when needed, and tests leave the user's caches alone."""

from importlib import metadata

from running import python

import ncti


def loaded_after(statement: str) -> set[str]:
    """Return names of all modules that a new process has loaded after a statement."""
    done = python("-c", f"{statement}\nimport sys\nprint(*sys.modules)")
    return set(done.stdout.split())


def test_importing_ncti_loads_no_other_library():
    found = loaded_after("import ncti")
    assert {name for name in found if name.startswith("ncti")} == {"ncti"}
    assert not found & {"numpy", "scipy", "sklearn", "trimesh", "xarray"}


def test_tests_never_touch_the_cache_of_the_user(tmp_path):
    """It holds also for examples of the library alone, with ships, which a cache keeps."""
    example = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "ncti/ships/loading.py")
    names = ("HOME", "XDG_CACHE_HOME", "SWEEP_CACHE", "NUMBA_CACHE_DIR")
    places = {name: str(tmp_path / name) for name in names}
    assert " passed" in python(*example, **places).stdout
    assert not list(tmp_path.iterdir())


def test_the_library_has_the_version_of_its_distribution():
    assert ncti.__version__ == metadata.version("ncti-sweep")


def test_command_line_loads_no_slow_library():
    found = loaded_after("from sweeps.app import make_command\nmake_command()")
    assert "sweeps.experiment" in found
    assert not found & {
        *("dask", "distributed", "matplotlib", "networkx", "numba", "pandas", "pyrender"),
        *("scipy", "skimage", "sklearn", "trimesh", "xarray", "zarr"),
    }


def test_one_profile_of_a_ship_loads_no_mesh_library():
    ncti.ships.load("duncan")  # so that it need not be built
    found = loaded_after("import ncti.simulate\nncti.simulate.range_profile('duncan', aspect=30)")
    assert "ncti.ladar.extent" in found
    assert not found & {"networkx", "sklearn", "trimesh"}
