"""The article's statements on design are checked by closed forms and simulated frames."""

import numpy as np
import pytest

from docs._tables import design
from ncti.infrared import snr
from ncti.ladar import power_ratio


def test_passive_ratio_of_table_1_is_not_32_db():
    """A ratio of 7.2 is 8.6 dB, and 32 dB by no definition of the decibel."""
    (_, _, ours), (_, _, needed) = design.passive_ratio()
    assert ours == "8.6 dB"
    assert float(snr(100e3)) == pytest.approx(7.2, abs=0.05)
    assert needed == "4.0 K, 32 K"  # 0.1 K sqrt(10^3.2), behind 18.1 dB
    assert 20 * np.log10(7.2) < 18


@pytest.mark.parametrize(("decibels", "pulse_width"), [(32, 30e-9), (40, 30e-9), (40, 50e-9)])
def test_range_errors_reach_the_precision_bound(decibels, pulse_width):
    """Two-sided quantiles are Student's with two degrees of freedom, q sqrt(2 / (1 - q^2)).

    A quantile of n errors lies within 5 sqrt(q (1 - q) / n) / density of its own; the parabola
    through bins costs 2 % at most, as it does not use the noise's correlation.
    """
    cnr, frames = power_ratio(decibels), 8000
    rng = np.random.default_rng(3)
    asked = {"cnr": cnr, "pulse_width": pulse_width}
    off = np.sort(np.abs(design.range_errors(**asked, frames=frames, rng=rng)))
    off /= design.precision(**asked)
    for share in (0.25, 0.5, 0.68):
        expected = share * np.sqrt(2 / (1 - share**2))
        density = 2 / (2 + expected**2) ** 1.5
        spread = 5 * np.sqrt(share * (1 - share) / frames) / density
        found = off[round(share * frames)]
        assert expected - spread <= found <= 1.02 * expected + spread


def test_one_metre_of_precision_is_met():
    """Errors within 0.5 m = t d have probability t / sqrt(2 + t^2), by two degrees of freedom."""
    t = 0.5 / design.precision(cnr=power_ratio(32), pulse_width=30e-9)
    assert t / np.sqrt(2 + t**2) == pytest.approx(0.976, abs=0.001)


def test_pixels_of_18_m_hardly_change_a_profile():
    ((_, _, said),) = design.pixels(ships=("duncan", "texas"), aspects=(0.0, 45.0, 90.0))
    assert float(said.split("least ")[1].split(";")[0]) >= 0.985
