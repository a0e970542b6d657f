"""Radiometry reproduces Table 1 of the article digit by digit."""

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
