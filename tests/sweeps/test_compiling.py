"""Loops are compiled once by the command; what runs them afterwards compiles nothing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ncti.render.choice import choose_engine

FEW = "grid.aspect=[0,90]", "grid.pulse_width=30", "infrared.range=50", "classifier.name=[acn]"
SMOKE = "+experiment=smoke", *FEW

COMPILE = """
import sys
from sweeps.experiment import EXPERIMENT
from commands import chosen
choices = chosen(*sys.argv[1:])
asked = {stage.function for stage in EXPERIMENT.stages if stage.when(choices)}
EXPERIMENT.prepare(choices, set(), print)
assert "numba" not in sys.modules
EXPERIMENT.prepare(choices, asked, print)
"""
AGAIN = """
from sweeps.app import main
try:
    main(["render.engine=lines", "grid.ship=duncan", "dry_run=true"])
except SystemExit as status:
    assert not status.code
print("numba" in sys.modules)
"""
RUN = """
import numpy as np
from ncti.infrared import SUPER_RESOLUTIONS, image
from ncti.ladar import RangeExtent, sample_frames
from ncti.ladar.receivers import RECEIVERS
from ncti.render import RangeImage

rng = np.random.default_rng(0)
pulse = {"pulse_width": 3e-8, "cnr": 1e3, "rng": rng}
for ifovs in (0, 1, 40):
    fraction = np.zeros((ifovs, 30))
    fraction[:, 10:14] = 0.25
    cell = np.zeros((ifovs, 2), dtype=np.int64)
    extent = RangeExtent(fraction, np.arange(30.0), 1.0, cell, 1e-4, 1e5)
    for receiver in RECEIVERS:
        for frames in (1, 2, 9, 33):
            for free in (0, 1, 70, 200):
                given = {"frame_count": frames, "target_free_ifovs": free, "receiver": receiver}
                sample_frames(extent.mirrored(), **pulse, **given)

down_range = np.full((30, 41), np.nan)
down_range[5:20, 3:30] = 0.0
slope = np.zeros((30, 41, 2), dtype=np.float32)
seen = RangeImage(down_range, slope, 0.25, (-3.0, -4.0), 30.0, 3.0, 20.0)
for way in SUPER_RESOLUTIONS:
    for counts in (1, [16], [4, 5, 64]):
        given = {"slant_range": 2e4, "frame_count": counts, "super_resolution": way}
        image(seen, rng=rng, **given)
"""


def run(*arguments, at, **environment):
    """Run Python where machine code is kept in a folder; return what it prints."""
    tests = Path(__file__).resolve().parents[1]
    paths = [tests.parent, tests / "sweeps", tests / "engine"]
    environment |= {"PYTHONPATH": os.pathsep.join(map(str, paths)), "NUMBA_CACHE_DIR": str(at)}
    done = subprocess.run(
        [sys.executable, *arguments],
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def kept(folder):
    """Machine code, and when it was written."""
    return {(file.name, file.stat().st_mtime_ns) for file in folder.rglob("*.nb[ci]")}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Folder of machine code, of what the smoke experiment runs."""
    folder = tmp_path_factory.mktemp("compiled")
    said = run("-c", COMPILE, *SMOKE, at=folder)
    ofs = (f"the engine {choose_engine('auto')}", "sampled frames", "infrared images")
    lines = [f"compiling the loops of {one} (once, a few seconds)" for one in ofs]
    assert [line for line in said.splitlines() if "compiling" in line] == lines
    return folder


def test_kept_loops_are_all_that_frames_and_images_run(compiled):
    before = kept(compiled)
    assert run("-c", RUN, at=compiled) == ""
    assert kept(compiled) == before


def test_numba_is_imported_neither_where_all_is_kept_nor_to_look_at_a_sweep(compiled):
    said = run("-c", COMPILE + AGAIN, *SMOKE, at=compiled)
    assert "to compute" in said  # of lines, which are not compiled here
    assert "compiling" not in said
    assert said.splitlines()[-1] == "False"


def test_smoke_compiles_nothing_again(compiled, folder, cache):
    (folder / "cache").mkdir()
    (folder / "cache" / "meshes").symlink_to(cache / "meshes")  # ships are built already
    before = kept(compiled)
    new = "cache=cache", "store=s.zarr", "cluster=inline"
    said = run("-m", "sweeps.app", *SMOKE, *new, at=compiled)
    assert ", 0 reused from the cache" in said
    assert "compiling loops" not in said
    assert kept(compiled) == before
