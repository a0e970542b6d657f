"""Cache and threads of all tests; doctests of the library wherever a part of it is tested."""

from __future__ import annotations

import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from _pytest.doctest import DoctestModule

from sweeps.engine.run.interpreter import relax_gc

LIBRARY = tuple(Path(__file__).parent / name for name in ("ncti", "studies"))

# Ships and compiled loops are kept from run to run, and never in the cache of whoever runs tests.
os.environ["XDG_CACHE_HOME"] = str(Path(__file__).parent / ".pytest_cache" / "home")
for variable in ("SWEEP_CACHE", "NUMBA_CACHE_DIR"):  # which would come first
    os.environ.pop(variable, None)
# Bytecode is kept, too: each of some hundred processes would compile every module that it imports.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# Before numpy is imported. Tests run in as many processes as there are cores, and threads of BLAS
# that wait for a core spin: products of noise then take ten times as long.
for library in ("OMP", "MKL", "OPENBLAS"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

relax_gc()

LONG = (
    *("sweeps/test_experiments", "claims/test_claims", "test_docs", "docs/test_results"),
    *("convergence/test_extent_of_ships", "engine/test_survival", "ships/test_variants"),
    *("engine/test_command", "report/test_flight_pictures", "stages/test_flights"),
    *("data/test_rows", "benchmarks/test_benchmark", "report/test_output"),
    *("engine/test_executors", "engine/test_buckets", "sweeps/test_values_in_company"),
)
"""Files of tests that take ten seconds or more, the longest first."""


def pytest_configure(config: Any) -> None:
    """Compile all loops once, before the processes of tests, each of which would compile them."""
    if not getattr(config.option, "numprocesses", None) or hasattr(config, "workerinput"):
        return
    from ncti.classify.loops import DENSITIES
    from ncti.compiled import keep
    from ncti.infrared.loops import IMAGES
    from ncti.irar.loops import TILTS
    from ncti.ladar.loops import BOXES, FRAMES
    from ncti.render.loops import engine_loops

    engines = map(engine_loops, ("lines", "embree", "osmesa", "mask"))
    every = (*engines, FRAMES, IMAGES, DENSITIES, TILTS, BOXES)
    if missing := [loops for loops in every if loops.are_missing()]:
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(min(len(missing), os.cpu_count() or 1), spawn) as pool:
            list(pool.map(keep, missing))


def pytest_collection_modifyitems(items: list[Any]) -> None:
    """Begin with long files, so that no process is left with one when the others have ended."""

    def place(item: Any) -> int:
        name = str(item.path.with_suffix(""))
        return next((k for k, ending in enumerate(LONG) if name.endswith(ending)), len(LONG))

    items.sort(key=place)


def pytest_collect_file(file_path: Path, parent: Any) -> DoctestModule | None:
    """Collect the examples in docstrings of a module of the library.

    `--doctest-modules` would import every module of every folder: tests, whose helpers have no
    examples, and `ncti.render.canvas`, which binds OpenGL to a platform. Modules without an example
    are therefore never imported here.
    """
    if file_path.suffix != ".py" or not {*LIBRARY} & {*file_path.parents}:
        return None
    if parent.config.option.doctestmodules or ">>>" not in file_path.read_text(encoding="utf-8"):
        return None
    module: DoctestModule = DoctestModule.from_parent(parent, path=file_path)
    return module
