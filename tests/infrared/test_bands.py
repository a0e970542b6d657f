"""Band radiance and contrast agree with quadrature of Planck's law and its limits."""

import math

import numpy as np
import pytest
from scipy import constants
from scipy.integrate import quad

from ncti.infrared import CONTRAST_AT_ZERO, LONG_WAVE, MID_WAVE, band_contrast, contrast
from ncti.infrared.bands import band_radiance, radiance_slope

BANDS = [LONG_WAVE, MID_WAVE, (10.5e-6, 10.7e-6), (0.4e-6, 0.7e-6), (20e-6, 900e-6), (1e-6, 5e-5)]
TEMPERATURES = [150.0, 288.15, 320.0, 1200.0]


def planck(wavelength, temperature):
    """Return the spectral radiance [W m-2 sr-1 m-1] by Planck's law."""
    x = constants.h * constants.c / (wavelength * constants.k * temperature)
    return 2 * constants.h * constants.c**2 / wavelength**5 / math.expm1(x)


def planck_slope(wavelength, temperature):
    """Return the derivative of spectral radiance with respect to temperature."""
    x = constants.h * constants.c / (wavelength * constants.k * temperature)
    return planck(wavelength, temperature) * x / temperature / -math.expm1(-x)


def integrated(law, temperature, band):
    """Return the integral by quadrature over log wavelength, to a relative 1e-12."""
    ends = np.log(band)
    integral, error = quad(
        lambda u: math.exp(u) * law(math.exp(u), temperature),
        *ends,
        epsabs=0,
        epsrel=1e-12,
        limit=500,
    )
    assert error < 1e-10 * integral
    return integral


@pytest.mark.parametrize("band", BANDS)
@pytest.mark.parametrize("temperature", TEMPERATURES)
def test_band_radiance_and_slope_match_plancks_law(band, temperature):
    """Agree to 1e-10, as the band is a difference, at worst a thousandth of its terms."""
    for ours, law in ((band_radiance, planck), (radiance_slope, planck_slope)):
        value = ours(temperature, band=band)
        assert value == pytest.approx(integrated(law, temperature, band), rel=1e-10)


@pytest.mark.parametrize("temperature", TEMPERATURES)
def test_total_radiance_obeys_stefan_boltzmann_law(temperature):
    """Radiance beyond the band, 2 c k T / (3 lambda^3) by Rayleigh and Jeans, is negligible."""
    band = (1e-8, 0.1)
    total = constants.sigma * temperature**4 / math.pi
    beyond = 2 * constants.c * constants.k * temperature / (3 * band[1] ** 3)
    assert beyond < 1e-9 * total
    # CODATA prints sigma to ten digits.
    assert band_radiance(temperature, band=band) == pytest.approx(total, rel=1e-9)
    slope = 4 * constants.sigma * temperature**3 / math.pi
    assert radiance_slope(temperature, band=band) == pytest.approx(slope, rel=1e-9)


def test_band_contrast_is_linear_for_small_differences():
    """For 2.16 K it is 1.2 % more at 8 to 12 um and 3.6 % at 3 to 5 um, as radiance is convex."""
    clear = {"extinction": 0.0}
    for band, bent in ((LONG_WAVE, 0.012), (MID_WAVE, 0.036)):
        small = band_contrast(1e3, band=band, contrast_at_zero=1e-3, **clear)
        assert small == pytest.approx(1e-3, rel=1e-4)
        assert band_contrast(0.0, band=band, contrast_at_zero=0.0, **clear) == 0
        full = band_contrast(0.0, band=band, **clear)
        assert full / CONTRAST_AT_ZERO - 1 == pytest.approx(bent, abs=5e-4)
        cold = band_contrast(0.0, band=band, contrast_at_zero=-CONTRAST_AT_ZERO, **clear)
        assert 0 > cold > -CONTRAST_AT_ZERO


def test_extinction_attenuates_band_contrast():
    """10 dB leave a tenth, for any shape; the imager's law, of SNR, has half the loss."""
    ranges = np.array([[0.0, 1e4], [2e4, 4e4]])
    contrasts = band_contrast(ranges, extinction=1e-3)
    np.testing.assert_allclose(contrasts / contrasts[0, 0], 10.0 ** (-ranges / 1e4), rtol=1e-14)
    ours = band_contrast(2e4, extinction=0.5e-3) / band_contrast(0.0)
    assert ours == pytest.approx(contrast(2e4, extinction=1e-3) / CONTRAST_AT_ZERO, rel=1e-12)
