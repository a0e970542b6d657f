"""Synthetic signatures of flights are equal to profiles of the range channel."""

import math

import numpy as np
from commands import opened
from flight_sweeps import at, flown

import ncti.ships
from ncti.ladar import cumulative_average, expected_profile, range_extent, sample_frames
from ncti.render import range_image
from sweeps.engine.resolve.streams import cell_rng


def test_synthetic_signatures_match_the_range_channel(folder):
    """View, sensor and depression are the flight's; tests have a random stream of their own."""
    settings = {"depression": 5, "profile_frames": [8, 16], "grid__replicate": 2}
    flights = opened(flown(folder, "deep", **settings), "validation")
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
        ours = at(flights, replicate=1, profile_frames=count).signature.isel(pulse_width=0)
        np.testing.assert_array_equal(ours.sel(kind="learned"), learned)
        test = cumulative_average(frames, (count,))[0].astype(np.float32)
        np.testing.assert_array_equal(ours.sel(kind="test"), test)
