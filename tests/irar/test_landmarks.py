"""Landmarks of near-stern profiles are found in schematic profiles and in rendered frigates."""

import math

import numpy as np
import pytest

from ncti import ships
from ncti.irar import landmarks, profile_correlation
from ncti.render import range_image

DEPRESSION = 6.7  # deg
PIXEL = 0.8  # m
CENTRES = np.arange(-125, 125) + 0.5


def binned(places, areas, half_widths, centres=CENTRES):
    """Return the bins' sums of boxes uniform in range."""
    step = centres[1] - centres[0]
    edges = np.append(centres - step / 2, centres[-1] + step / 2)
    before = np.zeros(edges.size)
    for r, a, h in zip(places, areas, np.maximum(half_widths, 1e-9), strict=True):
        before += a * np.clip((edges - (r - h)) / (2 * h), 0, 1)
    return np.diff(before)


def view(name, pixel=PIXEL):
    return range_image(
        ships.load(name),
        aspect=175,
        depression=DEPRESSION,
        pixel=pixel,
        roll=0,
        slant_range=4000,
    )


def ship_profile(image, *, spread, shift=0.0):
    """Return an image's profile, with pixels as points or spread over their extent in range."""
    hit = image.hit
    slope = np.abs(image.gradient[hit].astype(float)).sum(axis=-1)
    extent = spread * image.pixel * slope / 2
    area = np.full(hit.sum(), image.pixel**2)
    return binned(image.down_range[hit], area, extent, CENTRES + shift)


@pytest.fixture(scope="module", params=["duncan", "roberts"])
def frigate(request):
    return request.param, view(request.param)


# The hangar's offset from amidships, areas and depths of a schematic frigate.
PARTS = {
    "transom": (-66.5, 20.0, 0.7),
    "hangar": (-41.3, 60.0, 0.9),
    "mast": (3.1, 17.0, 0.6),
    "fore mast": (12.9, 8.0, 0.6),
    "forward": (18.0, 19.0, 0.7),
}


def schematic(shift=0.0):
    places, areas, halves = map(list, zip(*PARTS.values(), strict=True))
    # A smooth flight deck, and roofs as far as the bridge's front.
    places += [-54.0, -7.5]
    areas += [30.0, 40.0]
    halves += [12.0, 33.0]
    return binned(places, areas, halves, CENTRES + shift)


@pytest.mark.parametrize("shift", [0.0, 0.2, 0.4, 0.6, 0.8])
def test_landmarks_recover_schematic_positions(shift):
    """Places are within half a bin for any bin edges; their differences within 0.7 bin."""
    marks = landmarks(schematic(shift), CENTRES + shift)
    hangar = PARTS["hangar"][0]
    assert marks.hangar == pytest.approx(hangar, abs=0.5)
    assert marks.mast.offset == pytest.approx(PARTS["mast"][0] - hangar, abs=0.7)
    assert marks.forward.offset == pytest.approx(PARTS["forward"][0] - hangar, abs=0.7)
    assert marks.transom.offset == pytest.approx(PARTS["transom"][0] - hangar, abs=0.7)
    assert marks.stern == pytest.approx(hangar + 67.2, abs=1.0)
    # The roofs' far end, less 2 % of all that returns at their 40 / 66 a metre.
    front = 25.5 - 0.02 * 194 / (40 / 66)
    assert marks.bridge == pytest.approx(front - hangar, abs=0.5)
    assert marks.stern_to_bridge == pytest.approx(front + 67.2, abs=1.0)
    assert marks.deck_spikes == ()


def test_peak_energy_is_more_stable_than_height():
    """Shifts of the bins change heights by more than a quarter, energies by less than a tenth."""
    masts = [landmarks(schematic(s), CENTRES + s).mast for s in np.arange(0, 1, 0.1)]
    heights, energies = np.array([(p.height, p.energy) for p in masts]).T
    assert np.ptp(heights) / heights.mean() > 0.25
    assert np.ptp(energies) / energies.mean() < 0.1


def test_absent_peaks_are_not_detected():
    bare = binned([-66.5, -41.3], [20.0, 60.0], [0.7, 0.9])
    marks = landmarks(bare, CENTRES)
    for peak in (marks.mast, marks.forward):
        assert math.isnan(peak.offset)
        assert (peak.height, peak.energy) == (0.0, 0.0)


# Relative to the hangar: metres, and shares of its height at bins with whole edges.
FIGURE_16 = {
    "duncan": {"stern": 26, "transom": 0.37, "mast": (44, 0.26), "forward": (59, 0.33)},
    "roberts": {"stern": 28, "transom": 0.23, "mast": (45, 0.28), "forward": (60, 0.28)},
}


@pytest.mark.parametrize("spread", [0.0, 1.0])
def test_frigate_landmarks_match_figure_16(frigate, spread):
    """Places agree within a bin; heights within a quarter, as they depend on the bins' place."""
    name, image = frigate
    expected = FIGURE_16[name]
    marks = landmarks(ship_profile(image, spread=spread), CENTRES)
    assert marks.stern == pytest.approx(expected["stern"], abs=1.0)
    assert marks.transom.height == pytest.approx(expected["transom"], rel=0.25)
    for peak, (offset, height) in (
        (marks.mast, expected["mast"]),
        (marks.forward, expected["forward"]),
    ):
        assert peak.offset == pytest.approx(offset, abs=1.0)
        assert peak.height == pytest.approx(height, rel=0.25)


def test_deck_spikes_appear_only_without_pixel_spread(frigate):
    """Three spikes are a pixel's length apart in range for any bins; spread pixels give none."""
    _, image = frigate
    spacing = PIXEL / math.sin(math.radians(DEPRESSION))
    for shift in (0.0, 0.25, 0.5, 0.75):
        comb = landmarks(ship_profile(image, spread=0.0, shift=shift), CENTRES + shift)
        assert len(comb.deck_spikes) == 3
        # Two spacings between the outer ones, whose places are good to half a bin each.
        assert np.ptp(comb.deck_spikes) / 2 == pytest.approx(spacing, abs=0.5)
        smooth = landmarks(ship_profile(image, spread=1.0, shift=shift), CENTRES + shift)
        assert smooth.deck_spikes == ()


def test_profile_correlation_is_pearson_without_excluded_bins():
    rng = np.random.default_rng(0)
    first, second = rng.random((2, 4, 30))
    kept = np.ones(30, dtype=bool)
    kept[10:15] = False
    correlations = profile_correlation(first, second, exclude=~kept)
    expected = [np.corrcoef(a[kept], b[kept])[0, 1] for a, b in zip(first, second, strict=True)]
    np.testing.assert_allclose(correlations, expected, rtol=1e-12)
    np.testing.assert_allclose(profile_correlation(first, 3 * first + 5), 1.0, rtol=1e-12)
    np.testing.assert_allclose(profile_correlation(first, -first), -1.0, rtol=1e-12)
