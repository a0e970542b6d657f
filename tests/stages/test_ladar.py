"""Range profiles in the units of the configuration, and windows that hold ships."""

import math

import numpy as np
import pytest
from range_channel import choose

from ncti.features.profile import EDGE
from ncti.ladar import banded_frame_moments, expected_profile, noise_floor, range_extent
from ncti.ladar.pulse import SPEED_OF_LIGHT
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.seeds import cell_rng
from sweeps.experiment import MODULES
from sweeps.stages import ladar, views
from sweeps.stages.ladar import Ladar
from sweeps.stages.ships import ship_name

BEAM = (150.0, 1.0, 250.0, 0.5, "projected_area")  # ifov, bin_width, window, spread, reflectance


def signal(cnr, receiver="full_profile"):
    """What a receiver meets, with few target-free IFOVs."""
    return ladar.signal(cnr, 100, receiver, 1e-6)


@pytest.fixture(scope="module")
def image():
    mesh = views.mesh(views.hull(ship_name("duncan")))
    return views.image(mesh, 63.0, 3.84, None, "embree", 0.5, 0, views.ROLL, ())


@pytest.fixture(scope="module")
def ifovs(image):
    shift = ladar.shift()
    return ladar.ifovs(ladar.extent(image, 100.0, *BEAM, shift), 0.0, 0.0, 100.0, 150.0, 1.0, shift)


def test_an_extent_comes_back_from_its_arrays(image, ifovs):
    plain = range_extent(image, slant_range=100e3, ifov=150e-6, bin_width=1.0, window=250.0)
    for name in ("fraction", "down_range", "cell"):
        np.testing.assert_array_equal(getattr(ifovs, name), getattr(plain, name))
    assert (ifovs.ifov, ifovs.bin_width, ifovs.slant_range) == (150e-6, 1.0, 100e3)
    np.testing.assert_array_equal(ladar.profile_bins(250.0, 1.0), plain.down_range)


def test_profiles_are_the_library_in_the_units_of_the_configuration(ifovs):
    cnr = ladar.cnr_at_range(100.0, 32.0, 100.0, 0.0)
    assert cnr == pytest.approx(10**3.2)
    found = ladar.expected(ifovs, 30.0, signal(cnr))
    plain = expected_profile(ifovs, pulse_width=30e-9, cnr=cnr, target_free_ifovs=100)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, plain, rtol=1e-6)
    band = ladar.covariance(ifovs, 30.0, cnr, 100)
    _, moments = banded_frame_moments(ifovs, pulse_width=30e-9, cnr=cnr, target_free_ifovs=100)
    np.testing.assert_allclose(band, moments, rtol=1e-6)


def test_the_floor_is_that_of_every_ifov(ifovs):
    """Those on the ship included, as its ends are free of the pulse; what is left begins at 0."""
    profile = ladar.expected(ifovs, 30.0, signal(1600.0))
    found = ladar.above_floor(profile)
    level = (len(ifovs.cell) + 100) * noise_floor()
    np.testing.assert_allclose(found["noise_floor"], level, rtol=1e-6)
    np.testing.assert_allclose(found["floor_removed"] + found["noise_floor"], profile, rtol=1e-6)
    assert abs(found["floor_removed"][[0, -1]]).max() < 1e-6 * level
    assert found["floor_removed"].max() > 0


def test_extinction_reaches_the_profile_in_its_units():
    """0.1 dB/km over the 50 km less than the reference, both ways: 10 dB more, besides 4 times."""
    hazy = ladar.cnr_at_range(50.0, 20.0, 100.0, 0.1)
    assert hazy == pytest.approx(ladar.cnr_at_range(50.0, 30.0, 100.0, 0.0))
    assert hazy == pytest.approx(10**3 * 4)


@pytest.mark.parametrize("receiver", ["full_profile", "first_pulse"])
@pytest.mark.parametrize("counts", [(2,), (7, 40)])
def test_an_average_does_not_depend_on_the_others(ifovs, receiver, counts):
    """However many frames others take: it is a prefix of the same run."""

    def averages(*counts):
        met, rng = signal(1600.0, receiver), cell_rng(0, stage="test")
        return ladar.averaged(ifovs, 30.0, counts, met, rng=rng)

    whole = dict(zip((2, 7, 40), averages(2, 7, 40), strict=True))
    for count, found in zip(counts, averages(*counts), strict=True):
        np.testing.assert_array_equal(found, whole[count])


def test_noise_goes_by_the_names_that_it_always_had():
    """So that sweeps repeat, to the bit, what was drawn before."""
    names = [setting.name for setting in ladar.averaged.stream]
    wanted = ["ship", "aspect", "pulse_width", "range", "target_free_ifovs", "replicate"]
    assert names == [*wanted, "ifov_phase"]
    assert ladar.averaged.noise == "range_profile"
    assert [setting.name for setting in ladar.averaged.optional] == ["replicate", "ifov_phase"]


@pytest.mark.parametrize("phase", [0, 1, 5])
def test_what_is_drawn_for_the_other_side_has_its_phase(image, phase):
    """The place that is drawn is mirrored, so that the place seen is the phase's, but for whole
    IFOVs; the first phase is what is learned."""
    seen = ladar.seen_shift(phase, 300.0, 300.0)
    drawn = ladar.seen_shift(phase, 300.0, 60.0)
    assert (seen == drawn == ladar.shift()) if phase == 0 else seen != drawn
    assert repr(ladar.seen_shift(0, 300.0, 60.0)) == repr(ladar.shift())  # one cell
    extent = ladar.extent(image, 100.0, *BEAM, drawn)
    found = ladar.ifovs(extent, 300.0, 60.0, 100.0, 150.0, 1.0, drawn)
    gap = np.subtract(found.shift, seen)
    np.testing.assert_allclose(gap, np.rint(gap), atol=1e-12)


def test_lags_are_those_of_the_longest_band(ifovs):
    widths, ranges = (10.0, 30.0), (2.0, 100.0)
    bands = [
        ladar.covariance(ifovs, width, ladar.cnr_at_range(where, 32.0, 100.0, 0.0), 0)
        for width in widths
        for where in ranges
    ]
    found = ladar.lags(widths, ranges, (32.0,), (100.0,), (0.0,), 250.0, 1.0)
    np.testing.assert_array_equal(found, np.arange(max(map(len, bands))))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"ladar__window": 20, "ladar__bin_width": 2.5},
            "ladar.window is 20 m, but must hold at least 10 bins of ladar.bin_width 2.5 m",
        ),
        (
            {"ladar__receiver": ["peak_pulse", "full_profile"], "ladar__target_free_ifovs": 20_000},
            "ladar.target_free_ifovs has 20000, but must be at most 10000 with the peak_pulse "
            "receiver, which needs each of them drawn",
        ),
        (
            {"grid__pulse_width": [3, 30]},
            "grid.pulse_width has 3, but must be at least 9.43 for ladar.bin_width 1 m",
        ),
        (
            {"ladar__ifov": [1, 150]},
            "grid.range has 100, where ladar.ifov of 1 urad is 0.1 m wide, but must be at least "
            "render.pixel, 0.25 m",
        ),
    ],
)
def test_what_makes_no_sense_together_is_refused(given, said):
    with pytest.raises(ConfigurationError) as error:
        ladar.check(choose(**given))
    assert str(error.value) == said


def test_a_window_holds_every_ship_with_both_ends_free():
    hull = views.hull(ship_name("spruance"))
    reach = np.linalg.norm(views.read_mesh(hull).vertices, axis=1).max()
    pulse = 30e-9 * SPEED_OF_LIGHT / math.sqrt(2)
    needed = (2 * reach + pulse) / (1 - 2 * EDGE)
    ladar.check(choose(grid__ship="spruance", ladar__window=float(needed) + 1e-6))
    with pytest.raises(ConfigurationError, match=r"to hold spruance and leave 8% free"):
        ladar.check(choose(grid__ship="spruance", ladar__window=float(needed) - 1e-6))


def test_infrared_alone_asks_nothing_of_windows_and_pulses():
    ladar.check(choose(sensor="infrared", grid__pulse_width=1, ladar__window=20))


def test_covariances_are_stored_where_somebody_needs_them():
    def there(**given):
        return ladar.covariance.when(choose(**given))

    assert not there(classifier__name=["acn", "mnn"])
    assert there(classifier__name=["acn", "likelihood"])
    assert not there(classifier__name="likelihood", sensor="infrared")
    # Fusion names nothing without silhouettes.
    assert not there(classifier__name=["acn", "fusion"])
    assert there(classifier__name=["acn", "fusion"], sensor="both")


def test_classifiers_that_need_covariances_exist():
    assert set(ladar.WITH_MOMENTS) <= {one.NAME for one in MODULES if hasattr(one, "NAME")}


def test_what_shapes_arrays_is_no_axis():
    for setting in (Ladar.bin_width, Ladar.window):
        with pytest.raises(ConfigurationError, match="must have one: it shapes arrays"):
            setting.values([100, 200] if setting is Ladar.window else [1, 2])
