"""Table 1 of the article, digit by digit, and what its digits allow."""

import pytest

from ncti import infrared

RANGES = (25e3, 50e3, 100e3)


@pytest.mark.parametrize(
    ("slant_range", "printed_attenuation", "printed_contrast", "printed_snr"),
    [
        # The 164 is printed as 164.0: see the test of the intervals.
        (25e3, "4.5", "1.28", "164"),
        (50e3, "9.05", "0.76", "58.0"),
        (100e3, "18.1", "0.27", "7.2"),
    ],
)
def test_table_1(slant_range, printed_attenuation, printed_contrast, printed_snr):
    for printed, ours in (
        (printed_attenuation, infrared.attenuation(slant_range)),
        (printed_contrast, infrared.contrast(slant_range)),
        (printed_snr, infrared.snr(slant_range, frame_count=16)),
    ):
        decimals = len(printed.partition(".")[2])
        assert f"{ours:.{decimals}f}" == printed


def rounded(value, decimals):
    """Least and greatest number that prints so."""
    return value - 0.5 * 10**-decimals, value + 0.5 * 10**-decimals


def test_constants_are_inside_what_the_table_allows():
    extinctions = [
        (low / slant_range, high / slant_range)
        for slant_range, (low, high) in zip(
            RANGES, (rounded(4.5, 1), rounded(9.05, 2), rounded(18.1, 1)), strict=True
        )
    ]
    low, high = max(e[0] for e in extinctions), min(e[1] for e in extinctions)
    assert (low, high) == pytest.approx((0.1809e-3, 0.1811e-3))
    assert low < infrared.EXTINCTION < high

    # Given that extinction and 0.1 K: the contrast at zero from each ratio and each difference.
    gain = [10 ** (infrared.EXTINCTION * slant_range / 20) for slant_range in RANGES]
    ratios = (rounded(164, 0), rounded(58.0, 1), rounded(7.2, 1))
    differences = (rounded(1.28, 2), rounded(0.76, 2), rounded(0.27, 2))
    bounds = [
        (g * scale(low), g * scale(high))
        for intervals, scale in ((ratios, lambda x: 0.1 * x**0.5), (differences, float))
        for g, (low, high) in zip(gain, intervals, strict=True)
    ]
    low, high = max(b[0] for b in bounds), min(b[1] for b in bounds)
    assert (round(low, 4), round(high, 4)) == (2.1579, 2.1594)
    assert low < infrared.CONTRAST_AT_ZERO < high
    assert infrared.noise_temperature(16) == pytest.approx(0.1, rel=1e-15)


def test_limits():
    assert infrared.contrast(0.0) == infrared.CONTRAST_AT_ZERO
    assert infrared.attenuation(0.0) == 0.0
    assert infrared.contrast(1e9) == 0.0
    assert infrared.snr(25e3, extinction=0.0) == pytest.approx(
        infrared.snr(100e3, extinction=0.0), rel=1e-15
    )
    assert infrared.snr(25e3, contrast_at_zero=0.0) == 0.0
    assert infrared.contrast(1e3, contrast_at_zero=-1.0, extinction=0.0) == -1.0
    # 20 dB are a tenth of the temperature and a hundredth of the ratio.
    assert infrared.contrast(1e3, contrast_at_zero=1.0, extinction=20e-3) == pytest.approx(0.1)
    assert infrared.snr(1e3, contrast_at_zero=1.0, extinction=20e-3, frame_count=1, nedt=1.0) == (
        pytest.approx(0.01)
    )
    assert infrared.noise_temperature(1) == infrared.NEDT
    assert infrared.noise_temperature(7, nedt=0.0) == 0.0
