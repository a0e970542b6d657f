"""Compiled loops of sampled frames, and a small call that compiles them."""

from __future__ import annotations

import numpy as np

from ncti.ladar.extent import RangeExtent
from ncti.ladar.frames import sample_frames
from ncti.machine_code import Loops


def _sample() -> None:
    """Sample one small frame, which compiles its loops for the types that sweeps use."""
    nowhere = RangeExtent(
        np.zeros((0, 20)),
        np.arange(20.0),
        bin_width=1.0,
        cell=np.zeros((0, 2), np.int64),
        ifov=1e-4,
        slant_range=1e5,
    )
    rng = np.random.default_rng(0)
    sample_frames(nowhere, pulse_width=3e-8, cnr=1.0, frame_count=1, rng=rng, target_free_ifovs=1)


FRAMES = Loops(
    "sampled frames",
    (
        *("normals.put_streams", "normals.draw_run", "normals.draw_places"),
        "ladar.waveforms.put_magnitudes",
        "ladar.waveforms.add_in_turn",
    ),
    _sample,
)
