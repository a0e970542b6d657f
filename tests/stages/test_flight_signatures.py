"""Profiles and signatures of flights beside those of the range channel; ships only learned."""

import math

import numpy as np
from flight_sweeps import SMALL, at, flown, opened

import ncti.ships
from ncti.irar import (
    Flight,
    profile,
    ship_heading,
    ship_window,
    true_snapshot,
)
from ncti.ladar import (
    cumulative_average,
    expected_profile,
    range_extent,
    sample_frames,
)
from ncti.render import range_image
from sweeps.engine.seeds import cell_rng


def test_synthetic_signatures_are_those_of_the_range_channel(folder):
    """Same view, same sensor, drawn at the flight's depression; tests have a name of their own."""
    given = {"depression": 5, "profile_frames": [8, 16], "grid__replicate": 2}
    found = opened(flown(folder, "deep", **given))
    mesh = ncti.ships.load("roberts")
    view = {"aspect": 175.0, "depression": 5.0, "slant_range": 100e3, "engine": "embree"}
    image = range_image(mesh, pixel=0.5, **view)
    finer = 0.5 * max(math.sqrt(int(image.hit.sum()) / 20_000), 0.25)
    image = range_image(mesh, pixel=finer, **view)
    extent = range_extent(image, slant_range=100e3)
    sensor = {"pulse_width": 30e-9, "cnr": 10**3.2, "target_free_ifovs": 4000}
    learned = expected_profile(extent, **sensor).astype(np.float32)
    rng = cell_rng(
        0, stage="flight_signature", ship="roberts", aspect=175.0, depression=5.0,
        pulse_width=30.0, replicate=1,
    )  # fmt: skip
    frames = sample_frames(extent, frame_count=16, rng=rng, **sensor)
    for count in (8, 16):
        ours = at(found, replicate=1, profile_frames=count).signature.isel(pulse_width=0)
        np.testing.assert_array_equal(ours.sel(kind="learned"), learned)
        test = cumulative_average(frames, (count,))[0].astype(np.float32)
        np.testing.assert_array_equal(ours.sel(kind="test"), test)


def test_a_ship_that_is_not_flown_past_is_only_learned(folder):
    given = {"grid__ship": ["duncan", "roberts"], "flown": "roberts", "cnr": [15, 20]}
    path = flown(folder, "learned", **given)
    found = opened(path)
    for name, values in found.sel(ship="duncan").data_vars.items():
        if name != "signature":
            assert np.isnan(values).all(), name
            assert np.isfinite(found[name].sel(ship="roberts")).any(), name
    kinds = found.signature.sel(ship="duncan")
    assert np.isfinite(kinds.sel(kind=["learned", "test"])).all()
    assert np.isnan(kinds.sel(kind="measured")).all()
    # Its images take no room: the window is that of the other.
    alone = opened(flown(folder, "alone", cnr=[15, 20]))
    for dim in ("row", "column"):
        np.testing.assert_array_equal(alone[dim], found[dim])
        assert found[dim].attrs["units"] == "pixel" and "ship origin" in found[dim].long_name
    status = opened(path, "status_measured").cell.sel(ship="duncan")
    assert np.all(status.sel(kind="measured") == -1)
    assert np.all(status.sel(kind=["learned", "test"]) == 1)
    assert np.all(opened(path, "status").view == 1)


def test_other_bins_and_other_surfaces_are_those_of_the_sweep(folder):
    """Half-metre bins hold as much as metre ones; Lambertian ships return less, in flight, too."""
    coarse, fine, cosine = (
        at(opened(flown(folder, f"bins{k}", **given))).profile
        for k, given in enumerate(
            ({}, {"ladar__bin_width": 0.5}, {"ladar__reflectance": "lambertian"})
        )
    )
    pairs = fine.values.reshape(4, 250, 2).sum(axis=-1)
    # Points in space; spread pixels are binned to rounding, too.
    np.testing.assert_allclose(pairs[:2].sum(-1), coarse[:2].sum("down_range"), rtol=1e-5)
    np.testing.assert_allclose(pairs[0], coarse[0], rtol=1e-5, atol=1e-3)
    assert np.all(cosine.sum("down_range") < 0.95 * coarse.sum("down_range"))


def test_the_truth_is_of_the_flight_s_own_pulse(folder):
    """A pulse as long as a deck adds up what a short one tells apart, in the truth, too."""
    found = opened(flown(folder, "pulses", pulse_width=[10, 100]))
    mesh = ncti.ships.load("roberts")
    for pulse_width in (10, 100):
        flight = Flight(
            slant_range=3000.0,
            ship_heading=ship_heading(aspect=175.0, sight=5.0),
            cnr=100.0,
            pulse_width=pulse_width * 1e-9,
            **SMALL | {"ifov": 500e-6},
        )
        truth = true_snapshot(mesh, flight, ship_window(mesh, flight), cells=8)
        ours = at(found, flown_pulse_width=pulse_width).profile.sel(source="noiseless")
        np.testing.assert_allclose(ours, profile(truth, flight), rtol=1e-5)
