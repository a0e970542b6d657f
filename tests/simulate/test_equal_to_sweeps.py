"""Simulations equal the results of a sweep with the same settings, including the noise."""

import numpy as np
import pytest
from commands import chosen, opened, swept

from ncti import simulate
from ncti.infrared import IFOV
from ncti.ladar import noise_floor
from ncti.ladar.beam import Beam, Signal
from ncti.render.flight import DEPRESSION
from sweeps.engine.resolve.streams import cell_rng
from sweeps.stages.infrared import Infrared
from sweeps.stages.irar import FLOWN, RECORDED, Passive
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import Grid, Scene

SHIP, ASPECT, PULSE, RANGE = "texas", 40.0, 30.0, 50.0
FRAMES = (4, 16)
FREE = 200
ACCURACY = 0.01  # an accuracy that lines 0.25 m apart meet, so that the imager sees the same lines

FLIGHT = {"samples": 60, "line_rate": 60.0, "detectors": 3, "pulse_rate": 4000.0}
PIXEL = 7.5  # of the imager at 50 km [m]
EDGE = 2  # pixels of the window
FLOAT32 = 2.0**-24  # rounding of stored values


@pytest.fixture(scope="module")
def store(tmp_path_factory, cache):
    path = tmp_path_factory.mktemp("simulate") / "s.zarr"
    swept(
        path,
        cache,
        *(f"grid.ship={SHIP}", f"grid.aspect={ASPECT}", f"grid.pulse_width={PULSE}"),
        *(f"grid.range={RANGE}", f"grid.frame_count={list(FRAMES)}", "sensor=both", "seed=5"),
        *(f"ladar.target_free_ifovs={FREE}", f"render.tolerance={ACCURACY}"),
        *("infrared.subpixel_offsets=1", "infrared.orders=1", "classifier.name=acn"),
        "ladar.place=corner",
    )
    return path


def profile(frames):
    name = {"ship": SHIP, "aspect": ASPECT, "pulse_width": PULSE, "range": RANGE}
    rng = cell_rng(5, stage="range_profile", target_free_ifovs=FREE, **name)
    return simulate.range_profile(
        SHIP,
        aspect=ASPECT,
        pulse_width=PULSE * 1e-9,
        slant_range=RANGE * 1e3,
        frames=frames,
        accuracy=ACCURACY,
        target_free_ifovs=FREE,
        rng=rng,
    )


@pytest.mark.parametrize("frames", FRAMES)
def test_profiles_equal_sweep_results_minus_floor(store, frames):
    stored = opened(store, "range_profile").sel(frame_count=frames).squeeze()
    simulated = profile(frames)
    np.testing.assert_array_equal(simulated.down_range, stored.down_range)
    floors = []
    for ours, theirs in ((simulated.expected, stored.expected), (simulated, stored.averaged)):
        floor = theirs - ours.values
        floors.append(float(floor.mean()))
        # constant up to the rounding of the store, which is twice as large for a sum near it
        assert float(abs(floor - floors[-1]).max()) <= 2 * FLOAT32 * float(theirs.max())
    # both have one floor: of a whole number of IFOVs, with and without target
    np.testing.assert_allclose(floors[0], floors[1], rtol=2 * FLOAT32)
    ifovs = floors[0] / noise_floor()
    assert ifovs > FREE
    assert ifovs == pytest.approx(round(ifovs), rel=4 * FLOAT32)
    assert simulated.attrs["error_bound"] == pytest.approx(float(stored.profile_error), rel=1e-6)
    assert simulated.attrs["accuracy_reached"] == "yes"
    assert int(stored.within_tolerance) == 1


@pytest.mark.parametrize("way", ["none", "perfect", "shifted"])
def test_images_equal_sweep_results(store, way):
    place = {"super_resolution": way, "frame_count": 16}
    stored = opened(store, "infrared").image.sel(place).squeeze()
    key = {"ship": SHIP, "aspect": ASPECT, "range": RANGE}
    across, up = cell_rng(5, stage="infrared_place", **key).random(2)
    cells = 1 if way == "none" else 2  # of a pixel of the detector, along a side
    simulated = simulate.infrared_image(
        SHIP,
        aspect=ASPECT,
        slant_range=RANGE * 1e3,
        super_resolution=way,
        phase=(across * cells % 1, up * cells % 1),
        rng=cell_rng(5, stage="infrared", super_resolution=way, **key),
    )
    # Noise further than four pixels from those that show the ship depends on the window.
    ours = simulated[EDGE:-EDGE, EDGE:-EDGE].astype(np.float32)
    theirs = np.lib.stride_tricks.sliding_window_view(stored.values, ours.shape)
    [(row, column)] = np.argwhere((theirs == ours.values).all(axis=(-2, -1)))
    # The store has one place for every ship's pixels, which are off by the place of its origin in
    # a pixel, and by a whole one if that pushes the ship over its border.
    off = (
        (stored.vertical[row] - ours.vertical[0]) / PIXEL - up,
        (stored.horizontal[column] - ours.horizontal[0]) / PIXEL - across,
    )
    np.testing.assert_allclose(off, np.round(off), atol=1e-9)
    assert np.abs(off).max() < 1.5


def test_flights_equal_sweep_results(tmp_path, cache):
    options = (
        *("sensor=irar", "grid.ship=roberts", "grid.aspect=175", "render.engine=embree"),
        *("irar.range=3", "irar.ifov=500", "classifier.name=acn", "seed=5"),
        *(f"irar.{name}={value}" for name, value in FLIGHT.items()),
    )
    swept(tmp_path / "f.zarr", cache, *options)
    stored = opened(tmp_path / "f.zarr", "validation").squeeze()
    # The key of a flight's stream: all settings of the raw images except the passive band.
    choices = chosen(*options)
    key = {
        setting.name: choices.value(setting)
        for setting in {*FLOWN, *RECORDED} - {*Passive.declared}
    }
    simulated = simulate.flight(
        "roberts",
        aspect=175,
        slant_range=3000,
        ifov=500e-6,
        rng=cell_rng(5, stage="flight", ship="roberts", aspect=175.0, **key),
        **FLIGHT,
    )
    for ours, theirs in (
        ("corrected_intensity", "intensity"),
        ("corrected_range", "range_image"),
        ("corrected_infrared", "infrared_image"),
    ):
        image = simulated[ours].astype(np.float32)
        np.testing.assert_array_equal(image, stored[theirs])
    np.testing.assert_allclose(simulated.vertical, stored.row * 1.5)
    np.testing.assert_allclose(simulated.horizontal, stored.column * 1.5)


def test_defaults_equal_sweep_defaults():
    """Defaults agree after conversion to the units of the configuration."""
    for value, setting, unit in (
        (Beam.ifov, Ladar.ifov, 1e6),
        (Beam.bin_width, Ladar.bin_width, 1),
        (Beam.window, Ladar.window, 1),
        (Signal.target_free_ifovs, Ladar.target_free_ifovs, 1),
        (Signal.pulse_width, Grid.pulse_width, 1e9),
        (DEPRESSION, Scene.depression, 1),
        (IFOV, Infrared.ifov, 1e6),
    ):
        assert value * unit == pytest.approx(setting.default), setting.key
