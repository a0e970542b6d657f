"""Noise of different cells is drawn apart: along every axis that another measurement would have.

A setting that is missing from the name of a stream leaves every result as probable as it was, each
for itself. It shows only where cells are averaged: their noise then does not average out.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from commands import chosen, opened, swept

from ncti.render import line_image
from sweeps.engine.plan import Plan
from sweeps.experiment import EXPERIMENT
from sweeps.stages import infrared, irar
from sweeps.stages.infrared import Imager, look, pack_hits

RANGE = (
    *("sensor=range", "grid.ship=[duncan,texas]", "grid.aspect=[0,1]", "grid.pulse_width=[10,30]"),
    *("grid.range=[50,100]", "ladar.target_free_ifovs=[3000,4000]", "grid.replicate=2"),
    *("grid.frame_count=1", "render.engine=lines", "render.pixel=1", "render.samples=0"),
)
FLOWN = (
    *("sensor=irar", "grid.ship=[connole,roberts]", "grid.aspect=[175,176]", "grid.replicate=2"),
    *("grid.pulse_width=[10,30]", "irar.depression=[5,6.7]", "render.engine=embree"),
)
TIMED = (
    *("sensor=run_time", "grid.ship=[duncan,texas]", "grid.aspect=[0,1]", "render.engine=embree"),
    *("grid.pulse_width=[10,30]", "run_time.bin_width=[0.5,1]", "grid.frame_count=16"),
)


def streams(stage, *overrides):
    """Names of the noise of all cells of a stage, each with the values of its cell."""
    plan = Plan(EXPERIMENT, chosen(*overrides))
    bound = plan.bound[stage]
    return {
        repr(sorted(plan.stream(bound, place)[1].items())): place for place in plan.cells(bound)
    }, len(list(plan.cells(bound)))


@pytest.mark.parametrize(
    ("stage", "overrides", "cells"),
    [
        ("averaged", RANGE, 2**6),  # those of `OF_RANGE`, and the number of target-free IFOVs
        ("test_signature", FLOWN, 2**5),
        ("profile_noise", TIMED, 2**4),
    ],
)
def test_no_two_cells_have_one_stream(stage, overrides, cells):
    names, count = streams(stage, *overrides)
    assert count == cells
    assert len(names) == cells


def test_noise_of_profiles_that_differ_in_anything_is_uncorrelated(tmp_path, cache):
    """Of 2^6 cells, two by two at either pulse width.

    Bins l apart correlate by some exp(-4 l^2 / N_t^2), N_t = cT / 2 dR, so that the correlation of
    two cells over B bins has a variance of N_t sqrt(pi / 8) / B: at 30 ns 0.106 squared. Six times
    that is reached once in 5e8 pairs; cells that share their noise correlate by nearly 1.
    """
    swept(tmp_path / "s.zarr", cache, *RANGE)
    found = opened(tmp_path / "s.zarr", "range_profile")
    noise = (found.averaged - found.expected).squeeze("frame_count", drop=True)
    for width in noise.pulse_width.values:
        cells = noise.sel(pulse_width=width).transpose(..., "down_range").values
        alike = np.corrcoef(cells.reshape(-1, cells.shape[-1]))
        n_t = 299_792_458 * width * 1e-9 / 2
        reach = 6 * np.sqrt(max(1, n_t * np.sqrt(np.pi / 8)) / cells.shape[-1])
        pairs = np.abs(alike[np.triu_indices(len(alike), 1)])
        assert pairs.size == 32 * 31 / 2
        assert pairs.max() < reach < 0.7


class Recorded:
    """In the place of `cell_rng`: keeps what it is asked for."""

    def __init__(self):
        self.names = []

    def __call__(self, seed, **name):
        """As of `sweeps.engine.seeds.cell_rng`."""
        self.names.append(repr((seed, sorted(name.items()))))
        return np.random.default_rng(len(self.names))


def test_no_two_images_have_one_stream(monkeypatch, box):
    """Of two ships, aspects, ranges, seeds and ways of super-resolution; places on the detector
    are drawn apart, and are the same whatever the way."""
    drawn = Recorded()
    monkeypatch.setattr(infrared, "cell_rng", drawn)
    seen = pack_hits(line_image(box, aspect=30, depression=4, spacing=0.5))
    first = {"ship": "a", "aspect": 30.0, "range": 25e3, "seed": 0}
    imager = Imager(0.25, 2.0, 0.18e-3, 0.4, 0.1, 0.1)
    settings = {"drawn_aspect": 30.0, "ifov": 150e-6, "imager": imager}
    others = ({}, {"ship": "b"}, {"aspect": 31.0}, {"range": 50e3}, {"seed": 1})
    for other in others:
        found = look.function(hits=seen, **settings | first | other)
        for way in ("none", "perfect", "shifted"):
            found.images(way, (0, 1), (4,))
    # One stream of places, and one of noise for each way.
    assert len(drawn.names) == len(set(drawn.names)) == len(others) * 4


@pytest.fixture
def box():
    """A body that a few pixels see."""
    import trimesh

    return trimesh.creation.box((60.0, 15.0, 15.0)).apply_translation((0, 0, 7.5))


def test_no_two_scans_have_one_stream(monkeypatch):
    drawn = Recorded()
    monkeypatch.setattr(irar, "cell_rng", drawn)
    scan = SimpleNamespace(record=lambda rng: rng.random())
    monkeypatch.setattr(irar, "received", lambda flown, receivers: scan)
    monkeypatch.setattr(irar, "fly", lambda mesh, flight, **how: None)
    monkeypatch.setattr(irar, "surface", lambda *given: {})
    monkeypatch.setattr(irar, "flight_of", lambda *given: None)
    one = {"ship": "a", "aspect": 175.0, "seed": 0}
    course, receivers = {"range": 3.0, "jitter": 10.0}, {"cnr": 20.0, "replicate": 0}
    others = ({}, {"ship": "b"}, {"aspect": 176.0}, {"seed": 1})
    for other in others:
        irar.recorded(None, course, receivers, **one | other)
        for replicate in (0, 1):
            given = {"replicate": replicate, "reflectance": ""} | one | other
            irar.fly_past(None, course, **given)
    irar.recorded(None, course | {"range": 4.0}, receivers, **one)
    irar.recorded(None, course, receivers | {"replicate": 1}, **one)
    irar.recorded(None, course, receivers | {"cnr": 10.0}, **one)
    assert len(drawn.names) == len(set(drawn.names)) == 3 * len(others) + 3
    assert "replicate" in {one.name for one in irar.RECORDED}
