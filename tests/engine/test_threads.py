"""One thread for numerical libraries wherever tasks run, also in the process of the command."""

import os
from importlib import import_module

import numpy as np
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
    """The threads of the libraries of this process, as seen by what computes."""
    return {
        "most": max(library["num_threads"] for library in threadpool_info()),
        "told": int(os.environ["OMP_NUM_THREADS"]),
    }


def test_an_inline_stage_has_one_thread(tmp_path, monkeypatch):
    """OpenMP has a limit for each thread that calls it: that of another one does not count."""
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
