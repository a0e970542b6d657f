"""Radiometry reproduces Table 1 of the article digit by digit, and known limits."""

import pytest

from ncti import infrared


@pytest.mark.parametrize(
    ("slant_range", "printed_attenuation", "printed_contrast", "printed_snr"),
    [
        # The 164 is printed as 164.0.
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
    assert infrared.noise_temperature(16) == pytest.approx(0.1, rel=1e-15)
    assert infrared.noise_temperature(7, nedt=0.0) == 0.0
