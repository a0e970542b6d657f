"""The benchmark of lines beside pixels: errors in their order, and noise that is the same."""

import numpy as np

from benchmarks import lines
from ncti.ladar import range_extent, sample_frames
from ncti.render import line_image
from ncti.ships import load


def test_extents_made_alike_have_the_same_draws():
    """Coarse and fine lines: as one sees more IFOVs than the other, frames drawn from them as they
    are differ by all their noise, and made alike by a small part of it."""
    ship = load("duncan")
    extents = [
        range_extent(
            line_image(ship, aspect=7.0, depression=3.84, spacing=spacing), slant_range=100e3
        )
        for spacing in (2.0, 0.125)
    ]
    assert len(extents[0].cell) != len(extents[1].cell)

    def apart(pair):
        one, other = (
            sample_frames(
                extent,
                pulse_width=30e-9,
                cnr=10**3.2,
                frame_count=8,
                rng=np.random.default_rng(0),
            )
            for extent in pair
        )
        return np.abs(one - other).mean() / one.std(axis=0).mean()

    made = lines.alike(extents)
    for extent, own in zip(made, extents, strict=True):
        whole, seen = extent.fraction.sum(axis=0), own.fraction.sum(axis=0)
        np.testing.assert_allclose(whole, seen, rtol=1e-12, atol=1e-50)
    assert apart(made) < 0.3 * apart(extents)
