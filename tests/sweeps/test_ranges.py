"""The error bound of sweeps holds for views at near and far slant ranges."""

from __future__ import annotations

from collections import namedtuple

import numpy as np
import pytest
from commands import opened, swept

import ncti.ships
from ncti.ladar import RangeExtent, sample_frames
from ncti.ladar.pulse import Pulse, target_kernel, target_response
from ncti.render import Sampling
from ncti.render.view import ROLL
from studies.run_time.reference import reference_range_extent
from sweeps.stages import ladar, views
from sweeps.stages.ships import ship_name

View = namedtuple("View", ("ship", "aspect", "depression"))
ASPECT, DEPRESSION = 20.3, 3.84  # a view in which the far field errs most
TEXAS = View("texas", ASPECT, DEPRESSION)
RANGES = (1.0, 25.0)  # [km]
TOLERANCE = 1e-3
PULSE = 30.0  # [ns]
PIXEL = 0.14  # of lines that start; an IFOV at 1 km is 0.15 m wide
EDGES = np.arange(-125.0, 126.0)


def drawn_in_sweeps(
    slant_range: float, tolerance: float = TOLERANCE, *, view: View = TEXAS, skip: str = "all"
) -> RangeExtent:
    """Return the range extent of a ship at a range [km], by the stages of a sweep."""
    mesh_source = views.mesh_source(ship_name(view.ship))
    drawn = views.drawn_range(mesh_source, slant_range * 1e3, tolerance, skip)
    arguments = (drawn, Sampling(views.LINES, PIXEL, 0, ROLL), (tolerance, PULSE * 1e-9, 1.0))
    image = views.image(views.mesh(mesh_source), view.aspect, view.depression, *arguments)
    extent = ladar.extent(image, slant_range=slant_range * 1e3)
    return ladar.ifovs(extent, view.aspect, view.aspect)


def after_pulse(extent: np.ndarray) -> np.ndarray:
    return np.convolve(extent, target_response(Pulse(PULSE * 1e-9, 1.0)) ** 2)


def error(computed: np.ndarray, exact: np.ndarray) -> float:
    """Return the sum of absolute differences over the sum, after the pulse."""
    p, q = after_pulse(computed), after_pulse(exact)
    return float(np.abs(p - q).sum() / q.sum())


@pytest.fixture(scope="module")
def stored(tmp_path_factory, cache):
    """Return the profiles of the texas at all ranges."""
    path = tmp_path_factory.mktemp("ranges") / "s.zarr"
    swept(
        path,
        cache,
        *("grid.ship=texas", f"grid.aspect={ASPECT}", f"grid.pulse_width={PULSE}"),
        *(f"grid.range={list(RANGES)}", f"render.pixel={PIXEL}", "render.samples=0"),
        *(f"render.tolerance={TOLERANCE}", "grid.frame_count=1", "classifier.name=acn"),
        "ladar.target_free_ifovs=10",
    )
    return opened(path, "range_profile").squeeze()


@pytest.mark.parametrize("slant_range", [1.0, 25.0])
def test_the_error_that_a_sweep_states_covers_the_truth_at_any_range(stored, slant_range):
    """The truth unites outlines exactly, as they are seen from the range.

    Drawn in the far field, the texas errs by 8.8 % at 1 km and by 0.1 % at 100 km.
    """
    extent = drawn_in_sweeps(slant_range)
    view = {"aspect": ASPECT, "depression": DEPRESSION, "slant_range": slant_range * 1e3}
    exact = reference_range_extent(ncti.ships.load("texas"), **view, bin_edges=EDGES)
    side = slant_range * 1e3 * 150e-6
    truth = error(extent.fraction.sum(axis=0) * side**2, exact.area.sum(axis=0))
    view = stored.sel(range=slant_range)
    assert float(view.profile_error) == pytest.approx(extent.error_after(PULSE * 1e-9), rel=1e-6)
    assert truth <= float(view.profile_error) <= TOLERANCE
    assert int(view.within_tolerance) == 1


@pytest.mark.parametrize("aspect", [17.3, 342.7])
def test_noise_does_not_know_which_bins_a_drawing_occupies(aspect):
    """Frames of the horne at 900 km, shared far field and drawn there, differ as their fields do.

    A waveform moves by no more than its field. That is normal in each quadrature, and more than
    six sigma in one of 32 frames, 250 bins and two IFOVs has probability 16,000 exp(-18).
    """
    horne, cnr = View("horne", aspect, 0.0), 20.0
    far, near = (drawn_in_sweeps(900.0, 1e-2, view=horne, skip=skip) for skip in ("all", "none"))
    assert np.count_nonzero(far.fraction) != np.count_nonzero(near.fraction)
    signal = {"pulse_width": PULSE * 1e-9, "cnr": cnr, "frame_count": 32, "target_free_ifovs": 4000}
    far_frames, near_frames = (
        sample_frames(e, rng=np.random.default_rng(1), **signal) for e in (far, near)
    )
    kernel = target_kernel(Pulse(PULSE * 1e-9, 1.0), 250)
    moved = np.sqrt(cnr) * (np.sqrt(far.density) - np.sqrt(near.density))
    sigma = np.sqrt(moved**2 @ kernel**2).max(axis=1).sum()
    assert sigma < 1e-3
    assert np.abs(far_frames - near_frames).max() < 6 * sigma
