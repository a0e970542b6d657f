"""Expected profiles and sampled frames agree with the closed forms of the model."""

import numpy as np
import pytest
from plates import plane
from scipy import stats

import ncti.ships
from ncti import ladar
from ncti.ladar.budget import faintest_ratio
from ncti.ladar.frames import GAUSSIAN_FROM
from ncti.ladar.pulse import SPEED_OF_LIGHT, Pulse, noise_covariance, target_kernel, target_response
from ncti.ladar.window import shortest_window
from ncti.render import line_image

CNR = 10**3.2


@pytest.fixture(scope="module")
def stepped():
    """Return extents of a sloping plate over a few IFOVs, by bin width."""
    return {
        width: ladar.range_extent(
            plane(width=38, height=14, slope=(1.7, 0.4), offset=3.0),
            slant_range=1e5,
            bin_width=width,
            window=160.0,
        )
        for width in (0.5, 1.0)
    }


@pytest.mark.parametrize("bin_width", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("pulse_width", [10e-9, 30e-9, 50e-9])
def test_equation_c_for_one_bin(pulse_width, bin_width):
    """A face square to the line of sight gives Equation C as printed."""
    face = plane(width=30, height=30, offset=0.6)
    extent = ladar.range_extent(face, slant_range=1e8, ifov=150e-9, bin_width=bin_width)
    (bin_index,) = np.flatnonzero(extent.fraction.sum(axis=0))
    profile = ladar.expected_profile(extent, pulse_width=pulse_width, cnr=CNR)
    n_z = SPEED_OF_LIGHT * pulse_width / (np.sqrt(2) * bin_width)
    n = np.arange(profile.size) - bin_index
    b = np.sqrt(np.pi**3 / 2**5)
    by_hand = sum(
        np.sqrt(np.pi / 2 * CNR * beta * np.exp(-8 * n**2 / n_z**2) / n_z + b)
        for beta in extent.fraction[:, bin_index] / bin_width
    )
    np.testing.assert_allclose(profile, by_hand, rtol=1e-12)


def test_noise_covariance_matches_filtered_white_noise():
    """The covariance is the integral of h(x) h(x - l); intensity is 1/e^2 at half the width."""
    length = SPEED_OF_LIGHT * 30e-9 / 2
    x, step = np.linspace(-60, 60, 24001, retstep=True)
    filters = [np.exp(-4 * ((x - lag) / length) ** 2) / length**0.5 for lag in range(12)]
    covariance = noise_covariance(Pulse(30e-9, 1.0), 12)[0]
    np.testing.assert_allclose(covariance, step * np.array(filters) @ filters[0], rtol=1e-9)


@pytest.mark.parametrize("pulse_width", [10e-9, 50e-9])
def test_target_response_is_a_kernel_row(pulse_width):
    pulse = Pulse(pulse_width, 1.0)
    response = target_response(pulse)
    row = target_kernel(pulse, response.size)[response.size // 2]
    np.testing.assert_allclose(response, row, rtol=1e-13)


def test_pulse_too_short_for_the_bins_warns(stepped):
    with pytest.warns(UserWarning, match=r"9\.43e-09"):
        ladar.expected_profile(stepped[1.0], pulse_width=9e-9, cnr=CNR)
    ladar.expected_profile(stepped[0.5], pulse_width=9e-9, cnr=CNR)


def test_gaussian_sum_of_target_free_ifovs_agrees_with_drawing_each(stepped, monkeypatch):
    """Compare the short cut with the plain computation by KS tests at level 1e-3."""
    parameters = {"pulse_width": 30e-9, "cnr": CNR, "target_free_ifovs": 120}
    shortcut = ladar.sample_frames(
        stepped[1.0], frame_count=400, rng=np.random.default_rng(5), **parameters
    )
    monkeypatch.setattr("ncti.ladar.frames.GAUSSIAN_FROM", 10**9)
    plain = ladar.sample_frames(
        stepped[1.0], frame_count=400, rng=np.random.default_rng(6), **parameters
    )
    assert parameters["target_free_ifovs"] >= GAUSSIAN_FROM
    for bin_index in (0, 60, 85, 100):
        assert stats.ks_2samp(shortcut[:, bin_index], plain[:, bin_index]).pvalue > 1e-3 / 4


def test_carrier_to_noise_above_200_db_is_refused():
    with pytest.raises(ValueError, match=r"extinction is 0\.1 dB/m, but must be such .* 200 dB"):
        ladar.carrier_to_noise(50e3, extinction=0.1)


@pytest.mark.parametrize("ship", ["duncan", "texas"])
@pytest.mark.parametrize("pulse_width", [10e-9, 50e-9])
def test_faintest_signal_survives_float32_rounding(ship, pulse_width):
    """This holds from every side; at a thirtieth of the signal some views are flat."""
    mesh, sight = ncti.ships.load(ship), {"slant_range": 100e3, "ifov": 150e-6}
    least = faintest_ratio(mesh.extents, **sight, target_free_ifovs=4000)

    def steps(cnr):
        for aspect in (0.0, 33.0, 90.0, 180.0):
            lines = line_image(mesh, aspect=aspect, depression=3.84, spacing=0.5)
            extent = ladar.range_extent(lines, **sight)
            signal = {"pulse_width": pulse_width, "target_free_ifovs": 4000}
            profile = ladar.expected_profile(extent, cnr=cnr, **signal)
            yield np.unique(profile.astype(np.float32)).size - 1

    assert min(steps(least)) > 1
    assert min(steps(least / 30)) == 0


def test_the_shortest_window_holds_ship_and_pulse_between_its_edges():
    free = 0.08 * shortest_window(90.0, 30e-9)  # at each end
    pulse = 30e-9 * SPEED_OF_LIGHT / np.sqrt(2)
    assert shortest_window(90.0, 30e-9) == pytest.approx(2 * 90 + pulse + 2 * free)
