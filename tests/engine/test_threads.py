"""Numerical libraries use one thread wherever tasks run, also in the process of the command."""

import os
import shutil
from importlib import import_module
from pathlib import Path

import numpy as np
from running import ROOT, python
from small_stores import opened
from threadpoolctl import threadpool_info, threadpool_limits
from toys import Few, run_few

from sweeps.engine.declare.stage import Group, Output, stage


@stage(
    Output("most", label="largest limit of a library"),
    Output("told", label="what libraries loaded now are told"),
    uses=(Few,),
    group=Group("all"),
)
def threads(size):
    """Return the largest thread limit of loaded libraries, and OMP_NUM_THREADS, during a task."""
    return {
        "most": max(library["num_threads"] for library in threadpool_info()),
        "told": int(os.environ["OMP_NUM_THREADS"]),
    }


def test_an_inline_stage_has_one_thread(tmp_path, monkeypatch):
    """OpenMP has a limit for each calling thread, so the limit must be set in the task's thread."""
    import_module("sklearn.utils._openmp_helpers")  # loads an OpenMP library
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    with threadpool_limits(3):
        before = {library["filepath"]: library["num_threads"] for library in threadpool_info()}
        assert any(
            library["user_api"] == "openmp" and library["num_threads"] == 3
            for library in threadpool_info()
        )
        run_few([threads], tmp_path / "s.zarr")
        assert {
            library["filepath"]: library["num_threads"] for library in threadpool_info()
        } == before
    results = opened(tmp_path / "s.zarr", "all")
    np.testing.assert_array_equal(results.most, 1)
    np.testing.assert_array_equal(results.told, 1)
    assert os.environ["OMP_NUM_THREADS"] == "3"


IMPORTERS = """
import sys, threading
import toys

importers = set()

def note(event, arguments):
    if event == "import" and arguments[0].partition(".")[0] in {"dask", "distributed"}:
        if not hasattr(sys.modules.get("sweeps.engine.run.dask_cluster"), "DaskExecutor"):
            importers.add(threading.get_ident())

if __name__ == "__main__":
    sys.addaudithook(note)
    toys.go("s.zarr", "cache", "local", 1)
    print(len(importers))
"""


def test_no_two_threads_import_dask_at_once(tmp_path):
    """The modules of dask import each other: a second thread could see a half-imported one."""
    script = tmp_path / "script.py"
    script.write_text(IMPORTERS)
    path = os.pathsep.join(map(str, (ROOT, Path(__file__).parent, Path(__file__).parents[1])))
    for _ in range(3):
        assert python(script, cwd=tmp_path, PYTHONPATH=path).stdout.split()[-1] == "1"
        for folder in ("s.zarr", "cache"):
            shutil.rmtree(tmp_path / folder)
