"""Planck's law in a band: quadrature, Stefan and Boltzmann, both ends of the spectrum, contrast."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import constants
from scipy.integrate import quad

from ncti.infrared import (
    CONTRAST_AT_ZERO,
    LONG_WAVE,
    MID_WAVE,
    band_contrast,
    contrast,
)
from ncti.infrared.bands import (
    BOLTZMANN,
    PLANCK,
    SPEED_OF_LIGHT,
    band_radiance,
    radiance_slope,
)

BANDS = [LONG_WAVE, MID_WAVE, (10.5e-6, 10.7e-6), (0.4e-6, 0.7e-6), (20e-6, 900e-6), (1e-6, 5e-5)]
TEMPERATURES = [150.0, 288.15, 320.0, 1200.0]


def planck(wavelength, temperature):
    """Spectral radiance [W m-2 sr-1 m-1], straight from the law."""
    x = constants.h * constants.c / (wavelength * constants.k * temperature)
    return 2 * constants.h * constants.c**2 / wavelength**5 / math.expm1(x)


def planck_slope(wavelength, temperature):
    """Its derivative with respect to temperature."""
    x = constants.h * constants.c / (wavelength * constants.k * temperature)
    return planck(wavelength, temperature) * x / temperature / -math.expm1(-x)


def integrated(law, temperature, band):
    """By quadrature over the logarithm of the wavelength, to 1e-12 of itself."""
    ends = np.log(band)
    found, error = quad(
        lambda u: math.exp(u) * law(math.exp(u), temperature),
        *ends,
        epsabs=0,
        epsrel=1e-12,
        limit=500,
    )
    assert error < 1e-10 * found
    return found


def test_constants_are_exact():
    assert constants.h == PLANCK
    assert constants.k == BOLTZMANN
    assert constants.c == SPEED_OF_LIGHT


@pytest.mark.parametrize("band", BANDS)
@pytest.mark.parametrize("temperature", TEMPERATURES)
def test_radiance_and_its_slope_are_the_integrals_of_plancks_law(band, temperature):
    """To 1e-10: the band is a difference, which is at worst a thousandth of what it is between."""
    for ours, law in ((band_radiance, planck), (radiance_slope, planck_slope)):
        found = ours(temperature, band=band)
        assert found == pytest.approx(integrated(law, temperature, band), rel=1e-10)


@pytest.mark.parametrize("temperature", TEMPERATURES)
def test_all_wavelengths_are_stefan_and_boltzmanns_law(temperature):
    """But for what lies beyond, in Rayleigh and Jeans's limit 2 c k T / (3 lambda^3)."""
    band = (1e-8, 0.1)
    whole = constants.sigma * temperature**4 / math.pi
    beyond = 2 * constants.c * constants.k * temperature / (3 * band[1] ** 3)
    assert beyond < 1e-9 * whole
    # CODATA prints sigma to ten digits.
    assert band_radiance(temperature, band=band) == pytest.approx(whole, rel=1e-9)
    slope = 4 * constants.sigma * temperature**3 / math.pi
    assert radiance_slope(temperature, band=band) == pytest.approx(slope, rel=1e-9)


def test_long_waves_are_rayleighs_and_short_ones_wiens():
    """Rayleigh and Jeans: 2 c k T / 3 (1 / a^3 - 1 / b^3), off by x / 2; Wien, by exp(-x)."""
    far = (0.05, 0.1)
    cubes = far[0] ** -3 - far[1] ** -3
    x = constants.h * constants.c / (far[0] * constants.k * 300.0)
    long = 2 * constants.c * constants.k * 300.0 / 3 * cubes
    assert band_radiance(300.0, band=far) == pytest.approx(long, rel=x)
    near = (0.5e-6, 0.6e-6)
    x = constants.h * constants.c / (near[1] * constants.k * 300.0)

    def wien(wavelength, temperature):
        y = constants.h * constants.c / (wavelength * constants.k * temperature)
        return 2 * constants.h * constants.c**2 / wavelength**5 * math.exp(-y)

    expected = integrated(wien, 300.0, near)
    assert math.exp(-x) < 1e-10
    assert band_radiance(300.0, band=near) == pytest.approx(expected, rel=1e-9)


@given(
    st.floats(100, 2000),
    st.lists(st.floats(1e-6, 1e-4), min_size=3, max_size=3, unique=True).map(sorted),
)
def test_bands_add_and_radiance_rises_with_temperature(temperature, ends):
    first, middle, last = ends
    parts = [(first, middle), (middle, last), (first, last)]
    near, far, both = (band_radiance(temperature, band=band) for band in parts)
    # A narrow band is a difference of integrals that rounding knows to 1e-15 of the whole.
    rounding = 1e-14 * constants.sigma * temperature**4
    assert near + far == pytest.approx(both, rel=1e-12, abs=rounding)
    warmer = band_radiance(temperature + 1.0, band=parts[2])
    assert warmer >= both - 2 * rounding


@pytest.mark.parametrize("edge", [0.5, 1.0, 2.0])
def test_series_meet(edge):
    """Where x = h c / (lambda k T) passes 1, one series takes over from the other."""
    wavelength = constants.h * constants.c / (edge * constants.k * 300.0)
    band = (0.9 * wavelength, 1.1 * wavelength)
    expected = integrated(planck, 300.0, band)
    assert band_radiance(300.0, band=band) == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("band", [LONG_WAVE, MID_WAVE])
def test_slope_is_the_limit_of_differences(band):
    """Central differences: their error falls with the square of the step."""
    steps = np.array([8.0, 4.0, 2.0])
    slope = radiance_slope(288.15, band=band)
    above, below = (band_radiance(288.15 + sign * steps, band=band) for sign in (1, -1))
    errors = np.abs((above - below) / (2 * steps) - slope)
    rates = np.log2(errors[:-1] / errors[1:])
    np.testing.assert_allclose(rates, 2.0, atol=0.02)


def test_contrast_is_the_ships_own_for_small_differences():
    """And of 2.16 K is 1.2 % more at 8 to 12 um, 3.6 % at 3 to 5 um: radiance bends upwards."""
    clear = {"extinction": 0.0}
    for band, bent in ((LONG_WAVE, 0.012), (MID_WAVE, 0.036)):
        small = band_contrast(1e3, band=band, contrast_at_zero=1e-3, **clear)
        assert small == pytest.approx(1e-3, rel=1e-4)
        assert band_contrast(0.0, band=band, contrast_at_zero=0.0, **clear) == 0
        full = band_contrast(0.0, band=band, **clear)
        assert full / CONTRAST_AT_ZERO - 1 == pytest.approx(bent, abs=5e-4)
        cold = band_contrast(0.0, band=band, contrast_at_zero=-CONTRAST_AT_ZERO, **clear)
        assert 0 > cold > -CONTRAST_AT_ZERO


def test_air_takes_radiance():
    """10 dB leave a tenth, at (range) and any shape; twice the imager's law, of its SNR."""
    ranges = np.array([[0.0, 1e4], [2e4, 4e4]])
    found = band_contrast(ranges, extinction=1e-3)
    np.testing.assert_allclose(found / found[0, 0], 10.0 ** (-ranges / 1e4), rtol=1e-14)
    ours = band_contrast(2e4, extinction=0.5e-3) / band_contrast(0.0)
    assert ours == pytest.approx(contrast(2e4, extinction=1e-3) / CONTRAST_AT_ZERO, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"slant_range": -1.0}, r"slant_range is -1\.0"),
        ({"band": (12e-6, 8e-6)}, "band is 1.2e-05 to 8e-06 m, but must go from a shorter"),
        ({"band": (0.0, 8e-6)}, r"band is 0\.0, but must be a finite number above 0"),
        ({"sea_temperature": 0.0}, r"sea_temperature is 0\.0"),
        ({"extinction": -1.0}, r"extinction is -1\.0"),
        ({"contrast_at_zero": math.nan}, "contrast_at_zero is nan"),
        ({"contrast_at_zero": -400.0}, "contrast_at_zero is -400, but must be above -288.15"),
    ],
)
def test_bad_input_is_named(change, message):
    with pytest.raises(ValueError, match=message):
        band_contrast(**{"slant_range": 1e3} | change)
