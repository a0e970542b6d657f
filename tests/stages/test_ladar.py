"""Range profiles have the configuration's units and places, and windows hold ships."""

import math

import numpy as np
import pytest
from range_channel import called, choose
from scipy import stats

from ncti.ladar import banded_frame_moments, expected_profile, noise_floor
from ncti.ladar.pulse import SPEED_OF_LIGHT
from ncti.ladar.window import EDGE_SHARE
from ncti.render import Sampling
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.stages import ladar, meshes, views
from sweeps.stages.ships import ship_name

SIGNAL = {"pulse_width": 30e-9, "target_free_ifovs": 100}


@pytest.fixture(scope="module")
def image():
    mesh = views.mesh(views.mesh_source(ship_name("duncan")))
    return views.image(mesh, 63.0, 3.84, None, Sampling("embree", 0.5, 0, views.ROLL), ())


@pytest.fixture(scope="module")
def ifovs(image):
    return ladar.ifovs(ladar.extent(image, slant_range=100e3), 0.0, 0.0)


def test_cnr_and_covariance_match_the_library(ifovs):
    cnr = called(ladar.cnr_at_range, range=100e3)
    assert cnr == pytest.approx(10**3.2)
    band = ladar.covariance(ifovs, cnr=cnr, **SIGNAL)
    _, moments = banded_frame_moments(ifovs, cnr=cnr, **SIGNAL)
    np.testing.assert_array_equal(band, moments)


def test_noise_floor_counts_every_ifov(ifovs):
    """IFOVs on the ship count, too, as ends are free of the pulse; less the floor, they are 0."""
    profile = expected_profile(ifovs, cnr=1600.0, **SIGNAL)
    profiles = ladar.above_floor(profile)
    level = (len(ifovs.cell) + 100) * noise_floor()
    np.testing.assert_allclose(profiles["noise_floor"], level, rtol=1e-6)
    np.testing.assert_allclose(
        profiles["floor_removed"] + profiles["noise_floor"], profile, rtol=1e-6
    )
    assert abs(profiles["floor_removed"][[0, -1]]).max() < 1e-6 * level
    assert profiles["floor_removed"].max() > 0


def test_extinction_scales_the_cnr_with_range():
    """0.1 dB/km over 50 km less than the reference, both ways, is 10 dB more, besides 4 times."""
    hazy = called(ladar.cnr_at_range, range=50e3, cnr=20.0, extinction=0.1e-3)
    assert hazy == pytest.approx(called(ladar.cnr_at_range, range=50e3, cnr=30.0))
    assert hazy == pytest.approx(10**3 * 4)


def test_profile_error_is_checked_against_the_tolerance(ifovs):
    error = ladar.profile_error(ifovs, 30e-9)
    assert 0.001 < error < 0.1 and error == ifovs.error_after(30e-9)
    for tolerance, within in ((0.2, True), (0.0005, False)):
        fineness = ladar.fineness((50e-9, 30e-9), (1.0,), tolerance)
        assert fineness == (tolerance, 30e-9, 1.0)
        assert bool(ladar.within_tolerance(error, fineness)) is within
    assert ladar.fineness((50e-9, 30e-9), (1.0,), None) == ()


def place_of(drawn_aspect=300.0, **other):
    """Return the place of the ship in an average, by the settings that it depends on."""
    view = {"ship": "duncan", "aspect": 300.0, "range": 100e3, "replicate": 0, "seed": 0}
    return called(
        ladar.ifov_offset, **view | {"place": "random", "drawn_aspect": drawn_aspect} | other
    )


@pytest.mark.parametrize("place", ["corner", "random"])
def test_mirrored_views_mirror_the_place_of_the_ship(image, place):
    """The image is drawn at the mirrored place, so that the ship is seen at the view's place."""
    place_seen, drawn = place_of(place=place), place_of(60.0, place=place)
    assert (
        (place_seen == drawn == ladar.corner_offset()) if place == "corner" else place_seen != drawn
    )
    assert repr(place_of(60.0, place="corner")) == repr(ladar.corner_offset())  # one cell
    extent = ladar.ifovs(ladar.extent(image, slant_range=100e3, shift=drawn), 300.0, 60.0)
    assert extent.shift == place_seen


def test_places_are_uniform_and_independent_per_draw():
    """300 places pass Kolmogorov's test at 1e-3; another value of any setting draws another."""
    places = np.array(
        [place_of(float(a), aspect=float(a), replicate=r) for a in range(100) for r in range(3)]
    )
    for part in places.T:
        assert stats.kstest(part, "uniform").pvalue > 1e-3
    other = {"ship": "texas", "aspect": 301.0, "range": 50e3, "replicate": 1, "seed": 1}
    all_places = [place_of(), *(place_of(**{name: value}) for name, value in other.items())]
    assert len(set(all_places)) == len(all_places)
    assert np.abs(np.corrcoef(places.T)[0, 1]) < 3.3 / np.sqrt(len(places))


def test_window_must_hold_the_ship_with_both_ends_free():
    mesh_source = views.mesh_source(ship_name("spruance"))
    reach = np.linalg.norm(meshes.read_mesh(mesh_source).vertices, axis=1).max()
    pulse = 30e-9 * SPEED_OF_LIGHT / math.sqrt(2)
    needed = (2 * reach + pulse) / (1 - 2 * EDGE_SHARE)
    ladar.check(choose(grid__ship="spruance", ladar__window=float(needed) + 1e-6))
    with pytest.raises(ConfigurationError, match=r"to hold spruance and leave 8% free"):
        ladar.check(choose(grid__ship="spruance", ladar__window=float(needed) - 1e-6))


def test_covariances_are_stored_for_classifiers_that_declare_it(monkeypatch):
    """`docs/own_classifier.md` says so; here correlation stands for a user's classifier."""
    choices = choose(classifier__name="correlation")
    assert not ladar.stores_moments(choices)
    monkeypatch.setitem(ladar.WITH_MOMENTS, "correlation", {"range"})
    assert ladar.stores_moments(choices)
