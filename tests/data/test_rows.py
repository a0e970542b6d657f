"""Rows of data sets are reproducible, and have the stated mean, covariance and parameters."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import ncti
from ncti.data.draws import Bounds, sampler, uniform_numbers
from ncti.data.rows import IMAGER
from ncti.data.views import IMAGE_STREAM, Recipe
from ncti.features import map_vector, profile_vector, segment, silhouette_map
from ncti.ladar import frame_moments, range_extent
from ncti.render import drawn_range, line_image
from ncti.render.far_field import SHARE, reach_of
from ncti.simulate.subject import SPACING, roll_at

SHIPS = ["duncan", "texas"]
LEVEL = 1e-4  # of each statistical test
FLOAT32 = 2.0**-24
MIXED = {
    "aspect": [30.0, 75.0],
    "slant_range": [60e3, 100e3, 1000e3],  # in the far field at the last
    "pulse_width": (25e-9, 50e-9),
    "frames": (1, 3),
    "gain": stats.norm(1.0, 0.1),
    "floor": stats.uniform(-1.0, 2.0),
    "cnr": [26.0, 32.0],
    "target_free_ifovs": 100,
    "expected": True,
    "sensor": "both",
}


def rows_of(count, **how):
    return ncti.dataset(SHIPS, count, **{"seed": 7, "rows_per_view": 3, **MIXED, **how})


@pytest.fixture(scope="module")
def whole():
    return rows_of(40)


@settings(max_examples=25, deadline=None)
@given(first=st.integers(0, 39), count=st.integers(1, 40))
def test_rows_depend_only_on_their_numbers(whole, first, count):
    """This holds for rows that share a view or an image at other ranges, and for others."""
    count = min(count, 40 - first)
    assert rows_of(count, first=first).identical(whole[{"row": slice(first, first + count)}])


def test_rows_do_not_depend_on_worker_count(whole):
    assert rows_of(40, workers=2).identical(whole)


def test_draws_do_not_depend_on_other_parameters(whole):
    plain = rows_of(40, gain=1.0, floor=0.0)
    for name in ("ship", "aspect", "slant_range", "pulse_width", "cnr", "frames"):
        np.testing.assert_array_equal(plain[name], whole[name])
    assert not np.array_equal(plain.gain, whole.gain)
    # noise too, up to the rounding of float32
    noise, same = (dataset.profile - dataset.expected for dataset in (whole, plain))
    assert float(abs(noise - same).max()) <= 4 * FLOAT32 * float(whole.profile.max())


def test_ships_have_equal_numbers_of_views():
    """Each block of views has every ship once, in varying order, for any range of rows."""
    ships = ["duncan", "texas", "horne"]
    options = {"slant_range": 100e3, "frames": 1, "target_free_ifovs": 0, "rows_per_view": 2}
    names = ncti.dataset(ships, 120, seed=3, **options).ship.values[::2].reshape(20, 3)
    assert (np.sort(names, axis=1) == sorted(ships)).all()
    assert len({*map(tuple, names)}) > 3  # of six; 20 of three or fewer have odds below 1e-4
    later = ncti.dataset(ships, 7, first=17, seed=3, **options).ship.values
    np.testing.assert_array_equal(later, np.repeat(names.reshape(-1), 2)[17:24])


def test_expected_profiles_equal_simulated_ones(monkeypatch):
    """Both use the same lines and place on the IFOVs, and the far field if allowed."""
    corner = partial(range_extent, shift=(0.0, 0.0))
    monkeypatch.setattr(ncti.data.views, "range_extent", lambda *a, shift, **k: corner(*a, **k))
    accuracy = 0.01  # an accuracy that lines 0.25 m apart meet
    rows = rows_of(12, gain=1.0, floor=0.0, rows_per_view=1, far_field_error=SHARE * accuracy)
    for row in range(12):
        ours = rows.isel(row=row)
        theirs = ncti.simulate.range_profile(
            str(ours.ship.values),
            aspect=float(ours.aspect),
            pulse_width=float(ours.pulse_width),
            slant_range=float(ours.slant_range),
            cnr_db=float(ours.cnr),
            accuracy=accuracy,
            target_free_ifovs=100,
        )
        floor = ours.expected.values - theirs.expected.values
        assert np.ptp(floor) <= 4 * FLOAT32 * float(ours.expected.max())
        assert float(ours.error_bound) == theirs.error_bound


def test_rows_have_the_mean_and_covariance_of_their_frames():
    """Whitened deviations from expected profiles pass chi-square tests of mean and covariance.

    The twenty directions of most variance are tested. Averages of at least 8 frames of a hundred
    IFOVs and more are Gaussian to within 2 % of their kurtosis. Each row has the mean of its own
    place on the IFOVs; the covariance hardly depends on the place.
    """
    count, directions = 3000, 20
    options = {"aspect": 40.0, "slant_range": 100e3, "pulse_width": 30e-9, "cnr": 32.0}
    options |= {"frames": (8, 12), "sensor": "range"}
    rows = ncti.dataset(["duncan"], count, seed=11, rows_per_view=count, **{**MIXED, **options})
    mesh = ncti.ships.load("duncan")
    lines = line_image(
        mesh,
        aspect=40.0,
        depression=3.84,
        spacing=SPACING,
        roll=roll_at(40.0),
        slant_range=drawn_range(reach_of(mesh.vertices), 100e3),
    )
    signal = {"pulse_width": 30e-9, "cnr": 10**3.2, "target_free_ifovs": 100}
    # The target's part by the gain, and a shift in deviations of a frame.
    for k in range(0, count, 100):
        place = float(rows.right[k]), float(rows.up[k])
        extent = range_extent(lines, slant_range=100e3, shift=place)
        mean, covariance = frame_moments(extent, **signal)
        floor = (len(extent.fraction) + 100) * ncti.ladar.noise_floor()
        deviation = np.sqrt(np.diag(covariance).mean())
        expected = mean + float(rows.gain[k] - 1) * (mean - floor)
        expected += float(rows.floor[k]) * deviation
        np.testing.assert_allclose(rows.expected[k], expected, rtol=4 * FLOAT32)
    for shift in (rows.right, rows.up):
        assert stats.kstest(shift.values, "uniform").pvalue > LEVEL
    # Deviations of one frame, along eigenvectors of its covariance.
    variance, vectors = np.linalg.eigh(covariance)
    off = (rows.profile - rows.expected).values * np.sqrt(rows.frames.values)[:, None]
    whitened = off @ vectors[:, -directions:] / np.sqrt(variance[-directions:])
    assert stats.chi2.sf(count * (whitened.mean(axis=0) ** 2).sum(), directions) > LEVEL
    sample = whitened.T @ whitened / count
    below = np.tril_indices(directions, -1)
    squares = count * ((sample[below] ** 2).sum() + ((np.diag(sample) - 1) ** 2).sum() / 2)
    assert stats.chi2.sf(squares, directions * (directions + 1) // 2) > LEVEL
    # These tests have power: a wrong number of frames by one fails.
    wrong = sample * np.mean(rows.frames.values / (rows.frames.values + 1))
    assert stats.chi2.sf(count * ((np.diag(wrong) - 1) ** 2).sum() / 2, directions) < LEVEL


def test_noiseless_silhouettes_equal_simulated_ones():
    """Each has its own place on the pixels, drawn first in its stream, modulo whole pixels."""
    nothing = {"nedt": 1e-3, "target_spread": 0.0, "sea_spread": 0.0}
    imager = replace(IMAGER, **nothing)
    options = {"sensor": "infrared", "slant_range": [50e3, 100e3], "super_resolution": "perfect"}
    rows = ncti.dataset(SHIPS, 8, seed=5, rows_per_view=2, imager=imager, **options)
    for row in range(8):
        ours = rows.isel(row=row)
        across, up = 2 * Recipe.rng(SimpleNamespace(seed=5), IMAGE_STREAM, row).random(2) % 1
        image = ncti.simulate.infrared_image(
            str(ours.ship.values),
            aspect=float(ours.aspect),
            slant_range=float(ours.slant_range),
            phase=(across, up),
            super_resolution="perfect",
            **nothing,
        )
        expected = silhouette_map(segment(image.values, method="otsu"))
        np.testing.assert_array_equal(ours.silhouette, expected)


def test_ladar_parameters_without_ladar_are_refused():
    for name, value in {"cnr": 32.0, "gain": stats.norm(1), "floor": [0.0, 1.0]}.items():
        with pytest.raises(ValueError, match=rf"^{name} is .* without a laser radar"):
            ncti.dataset(SHIPS, 1, seed=0, sensor="infrared", **{name: value})


# Parameters

UNIFORM = uniform_numbers(3, 0, np.arange(20_000), 3)


def test_uniform_numbers_are_uniform_and_independent():
    for column in UNIFORM:
        assert stats.kstest(column, "uniform").pvalue > LEVEL
    for first, second in ((0, 1), (0, 2), (1, 2)):
        assert stats.pearsonr(UNIFORM[first], UNIFORM[second]).pvalue > LEVEL
        assert stats.pearsonr(UNIFORM[first, 1:], UNIFORM[second, :-1]).pvalue > LEVEL


def test_sampler_follows_the_given_distribution():
    anything, integers = Bounds(), Bounds(1, 9, whole=True)
    uniform = UNIFORM[0]
    assert set(sampler("gain", 3.0, anything)(uniform)) == {3.0}
    for choices, bounds, values in (
        ([1.0, 5.0, 2.0], anything, (1, 2, 5)),
        ((2, 4), integers, (2, 3, 4)),
    ):
        drawn, counts = np.unique(sampler("x", choices, bounds)(uniform), return_counts=True)
        assert drawn.tolist() == [*values]
        assert stats.chisquare(counts).pvalue > LEVEL
    interval = sampler("x", (2.0, 6.0), anything)(uniform)
    assert stats.kstest(interval, stats.uniform(2.0, 4.0).cdf).pvalue > LEVEL
    law = stats.lognorm(0.5)
    assert stats.kstest(sampler("x", law, anything)(uniform), law.cdf).pvalue > LEVEL


@pytest.mark.parametrize(
    "given",
    [(1.0,), (1.0, 2.0, 3.0), (2.0, 1.0), [], {"low": 1}, {1.0}, stats.gamma, stats.norm(9)],
)
def test_sampler_refuses_invalid_values_by_name(given):
    with pytest.raises(ValueError, match=r"^gain (is|has)\b"):
        sampler("gain", given, Bounds(0.0, 5.0))(UNIFORM[0])


# Vectors


def test_to_numpy_gives_feature_vectors_and_view_groups(whole):
    X, y, groups = ncti.to_numpy(whole)
    np.testing.assert_array_equal(X[:, :250], profile_vector(whole.profile.values))
    np.testing.assert_array_equal(X[:, 250:], map_vector(whole.silhouette.values))
    for name, part in (("profile", X[:, :250]), ("silhouette", X[:, 250:])):
        np.testing.assert_array_equal(ncti.to_numpy(whole[[name]])[0], part)
    assert y.tolist() == whole.ship.values.tolist()
    sights = list(zip(y, whole.aspect.values, whole.depression.values, strict=True))
    pairs = {(sight, group) for sight, group in zip(sights, groups, strict=True)}
    assert len(pairs) == len(set(sights)) == len(set(groups)) == 4  # two ships at two aspects
