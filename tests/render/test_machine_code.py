"""Compiled once, loops are found by every process that starts later."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ncti.render import available_engines

ENGINES = [*[one for one in available_engines() if one != "embree"][:1], "embree", "lines"]
KEEP = """
import sys
from ncti.render.loops import of_engine
loops = of_engine(sys.argv[1])
assert loops.are_missing()
assert "numba" not in sys.modules
from ncti.compiled import keep
keep(loops)
assert not loops.are_missing()
"""
DRAW = """
import sys
import numpy as np
import trimesh
from ncti.ladar import range_extent
from ncti.render import line_image, range_image
from ncti.render.loops import of_engine
[engine] = sys.argv[1:]
assert not of_engine(engine).are_missing()
assert "numba" not in sys.modules
hull = trimesh.creation.icosphere(subdivisions=2, radius=9.0)
for slant_range in (None, 2e4):
    view = {"aspect": 40.0, "depression": 3.84, "slant_range": slant_range}
    if engine == "lines":
        seen = line_image(hull, **view)
    else:
        seen = range_image(hull, engine=engine, **view)
    range_extent(seen, slant_range=2e4, ifov=1e-4, bin_width=1.0, window=100.0)
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_kept_loops_are_all_that_an_engine_runs(tmp_path, engine):
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": str(Path(__file__).resolve().parents[2]),
    }
    kept = []
    for script in (KEEP, DRAW):
        command = [sys.executable, "-c", script, engine]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert done.stderr == ""  # nothing is told of what was asked for
        kept.append({file.name for file in tmp_path.rglob("*.nbc")})
    assert kept[0] and kept[0] == kept[1]  # nothing was compiled to draw
