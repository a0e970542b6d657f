"""Compiled loops of range extents and of sampled frames, and small calls that compile them."""

from __future__ import annotations

import numpy as np

from ncti.ladar.extent import no_return
from ncti.ladar.frames import sample_frames
from ncti.machine_code import CompiledLoops


def _compile_frames() -> None:
    """Sample one small frame, which compiles its loops for the types that sweeps use."""
    no_ship, rng = no_return(20.0, 1.0), np.random.default_rng(0)
    sample_frames(no_ship, pulse_width=3e-8, cnr=1.0, frame_count=1, rng=rng, target_free_ifovs=1)


def _compile_boxes() -> None:
    """Bin one box, which compiles its loop."""
    from ncti.ladar.pixels import bin_boxes

    unit = np.ones(1)
    bin_boxes(np.zeros(1, np.intp), unit, unit, unit, 1, 4)


BOXES = CompiledLoops("range extents", ("ladar.pixels.bin_boxes",), _compile_boxes)

FRAMES = CompiledLoops(
    "sampled frames",
    (
        *("normals.put_streams", "normals.draw_run", "normals.draw_places"),
        "ladar.waveforms.put_magnitudes",
        "ladar.waveforms.accumulate_frames",
    ),
    _compile_frames,
)
