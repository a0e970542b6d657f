"""Compiled once, loops are found by every process that starts later."""

import errno
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from ncti import machine_code
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


@pytest.fixture
def compiled(tmp_path, monkeypatch):
    """What compiles a new function with a folder of machine code of its own, as if for any user."""
    before = os.umask(0)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "made" / "compiled"))
    for one in (machine_code.folder, machine_code.folder_of):
        one.cache_clear()

    def compiled():
        from ncti.compiled import compiled

        def halved(x):
            return x / 2

        return compiled(halved)

    yield compiled
    os.umask(before)
    for one in (machine_code.folder, machine_code.folder_of):
        one.cache_clear()


def test_a_full_disk_costs_the_machine_code_and_no_result(compiled, monkeypatch, tmp_path):
    caching = pytest.importorskip("numba.core.caching")

    def full(*given, **others):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    for name in ("save", "load"):
        monkeypatch.setattr(caching.IndexDataCacheFile, name, full)
    assert compiled()(5.0) == 2.5
    monkeypatch.setattr("tempfile.TemporaryFile", full)  # with which numba tries the folder
    assert compiled()(7.0) == 3.5
    assert not list(tmp_path.rglob("*.nbc"))


def test_machine_code_is_of_this_user_alone(compiled, tmp_path):
    assert compiled()(5.0) == 2.5
    made = [one for one in tmp_path.rglob("*") if one.is_dir()]
    assert len(made) == 3 and list(tmp_path.rglob("*.nbc"))
    assert {stat.S_IMODE(one.stat().st_mode) for one in made} == {0o700}


def test_machine_code_that_others_may_have_written_is_not_loaded(compiled, tmp_path):
    assert compiled()(5.0) == 2.5
    kept = list(tmp_path.rglob("*.nbc"))
    kept[0].parent.chmod(0o777)
    machine_code.folder_of.cache_clear()
    again = compiled()
    assert (
        again(5.0) == 2.5 and not again.stats.cache_hits and list(tmp_path.rglob("*.nbc")) == kept
    )


def test_a_constant_of_another_module_is_compiled_again(tmp_path):
    """Numba compares the time of the function's own file alone."""
    (tmp_path / "loops.py").write_text(
        "from depth import DEPTH\nfrom ncti.compiled import compiled\n"
        "@compiled\ndef deep(x):\n    return x * DEPTH\n"
        "print(deep(1), sum(deep.stats.cache_hits.values()))\n"
    )
    root = str(Path(__file__).resolve().parents[2])
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept"), "PYTHONPATH": root}

    def run(depth):
        (tmp_path / "depth.py").write_text(f"DEPTH = {depth}\n")
        done = subprocess.run(
            [sys.executable, "-B", "loops.py"],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.split()

    assert [run(2), run(2), run(30)] == [["2", "0"], ["2", "1"], ["30", "0"]]
