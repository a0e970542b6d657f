"""Shift-and-add: its operators, and what they do to scene and noise."""

import numpy as np
import pytest
from fine_templates import template
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from ncti.infrared import (
    back_project,
    detector_samples,
    enlarge,
    noise_gain,
    pixel_sigma,
    recombine,
    reconstruction_error,
    scene_gain,
    shifted_images,
    thermal_images,
)

LEVEL = 1e-3
sizes = st.integers(2, 17)


@given(rows=sizes, cols=sizes, seed=st.integers(0, 2**32 - 1))
def test_back_projection_is_the_adjoint(rows, cols, seed):
    """<B x, y> = <x, B^T y>, to the rounding of sums of as many products."""
    rng = np.random.default_rng(seed)
    x, y = rng.standard_normal((rows, cols)), rng.standard_normal((rows - 1, cols - 1))
    there, back = np.vdot(detector_samples(x), y), np.vdot(x, back_project(y))
    assert there == pytest.approx(back, abs=4 * x.size * 2.3e-16 * (1 + np.abs(x).max()) * 5)


@pytest.mark.parametrize("dy", [0, 1])
@pytest.mark.parametrize("dx", [0, 1])
def test_samples_are_four_detector_images_interlaced(dx, dy):
    """Each position by plain averaging of 2 x 2 blocks, on stacks too."""
    fine = np.random.default_rng(0).standard_normal((3, 9, 12))
    moved = fine[:, dy:, dx:]
    rows, cols = moved.shape[1] // 2, moved.shape[2] // 2
    blocks = moved[:, : 2 * rows, : 2 * cols].reshape(3, rows, 2, cols, 2).mean(axis=(2, 4))
    np.testing.assert_allclose(
        detector_samples(fine)[:, dy::2, dx::2], blocks, rtol=1e-13, atol=1e-15
    )


@given(value=st.floats(-1e6, 1e6), back_projections=st.integers(0, 6))
def test_a_constant_scene_is_kept(value, back_projections):
    fine = np.full((20, 23), value)
    samples = detector_samples(fine)
    np.testing.assert_array_equal(samples, np.full((19, 22), value))
    ours = recombine(samples, back_projections=back_projections)
    crop = 1 + back_projections
    assert ours.shape == (20 - 2 * crop, 23 - 2 * crop)
    # Sums of four equal numbers and quarters round nothing but subnormals.
    np.testing.assert_allclose(ours, value, rtol=0, atol=1e-300)


def test_without_noise_the_fine_scene_follows_exactly():
    """The article's algebra: half pixels one by one, from a rim that is known.

    On whole numbers the sums are exact, and so is the answer; with noise the same sums alternate
    in sign over the whole image, which is why nothing here solves them.
    """
    fine = np.random.default_rng(1).integers(-50, 50, (30, 40)).astype(float)
    samples = detector_samples(fine)
    solved = np.zeros_like(fine)
    solved[0], solved[:, 0] = fine[0], fine[:, 0]
    for row, col in np.ndindex(samples.shape):
        others = solved[row, col] + solved[row, col + 1] + solved[row + 1, col]
        solved[row + 1, col + 1] = 4 * samples[row, col] - others
    np.testing.assert_array_equal(solved, fine)


def test_the_true_scene_is_where_back_projection_rests():
    fine = np.random.default_rng(2).standard_normal((12, 15))
    residual = detector_samples(fine) - detector_samples(fine.copy())
    np.testing.assert_array_equal(fine + back_project(residual), fine)


def test_back_projection_approaches_what_the_detector_saw():
    """The residual falls at every step, by what B's spectrum says: no eigenvalue exceeds 1.

    On a torus B^T B has the eigenvalues cos^2(u/2) cos^2(v/2); on a bounded window they lie
    between the same bounds (Gershgorin: rows of B^T B sum to at most 1).
    """
    fine = np.random.default_rng(3).standard_normal((9, 8))
    matrix = np.stack([detector_samples(unit.reshape(9, 8)).ravel() for unit in np.eye(72)], 1)
    eigenvalues = np.linalg.eigvalsh(matrix.T @ matrix)
    assert eigenvalues[0] > -1e-12 and eigenvalues[-1] <= 1 + 1e-12
    samples = detector_samples(fine)
    estimate = back_project(samples)
    residuals = []
    for _ in range(200):
        estimate = estimate + back_project(samples - detector_samples(estimate))
        residuals.append(np.linalg.norm(samples - detector_samples(estimate)))
    assert np.all(np.diff(residuals) < 0)
    assert residuals[-1] < 0.05 * np.linalg.norm(samples)


def test_recombine_is_shift_and_add_by_definition():
    samples = np.random.default_rng(4).standard_normal((6, 7))
    by_hand = np.zeros((5, 6))
    for row, col in np.ndindex(by_hand.shape):
        by_hand[row, col] = samples[row : row + 2, col : col + 2].mean()
    np.testing.assert_allclose(recombine(samples, back_projections=0), by_hand, atol=1e-15)


@pytest.mark.parametrize("back_projections", [0, 1, 2, 3])
def test_recombination_knows_no_border(back_projections):
    """A part of the samples gives that part of the image, bit for bit."""
    samples = np.random.default_rng(5).standard_normal((2, 30, 31))
    whole = recombine(samples, back_projections=back_projections)
    part = recombine(samples[:, 3:-4, 5:-2], back_projections=back_projections)
    np.testing.assert_array_equal(part, whole[:, 3:-4, 5:-2])


def test_gains_of_shift_and_add_by_hand():
    # Four samples of a quarter each; weights (1, 2, 1) / 4 both ways, whose squares sum to 3/8, of
    # half pixels with twice the spread of a detector pixel.
    assert noise_gain(0) == pytest.approx(0.5, rel=1e-15)
    assert scene_gain(0) == pytest.approx(2 * 3 / 8, rel=1e-15)


@pytest.mark.parametrize("back_projections", [0, 1, 2, 3, 10])
def test_gains_are_their_spectra(back_projections):
    """Parseval: with b = cos(u/2) cos(v/2), the scene passes by 1 - (1 - b^2)^(n+1)."""
    u = 2 * np.pi * np.arange(64) / 64
    b = np.cos(u / 2)[:, None] * np.cos(u / 2)
    scene = 1 - (1 - b**2) ** (back_projections + 1)
    # Noise passes by scene / b, whose limit at the zeros of b is 0.
    noise = np.divide(scene, b, out=np.zeros_like(b), where=np.abs(b) > 1e-9)
    assert scene_gain(back_projections) == pytest.approx(2 * np.sqrt(np.mean(scene**2)), rel=1e-9)
    assert noise_gain(back_projections) == pytest.approx(np.sqrt(np.mean(noise**2)), rel=1e-9)


@pytest.mark.parametrize("back_projections", [0, 1, 3])
@pytest.mark.parametrize(("spread", "nedt"), [(0.0, 0.4), (0.1, 0.0), (0.1, 0.4)])
def test_deviation_of_the_images_is_what_the_gains_say(back_projections, spread, nedt):
    """2,000 images of 12 x 12, z-tests at 1e-3 of the middle, a corner and an edge alike."""
    rng = np.random.default_rng(6)
    images = np.stack(
        [
            shifted_images(
                np.zeros((12, 12), bool),
                contrast=1.0,
                frame_counts=(16,),
                rng=rng,
                nedt=nedt,
                sea_spread=spread,
                back_projections=back_projections,
            )[0]
            for _ in range(2000)
        ]
    )
    sigma = pixel_sigma(
        spread,
        frame_count=16,
        nedt=nedt,
        super_resolution="shifted",
        back_projections=back_projections,
    )
    for row, col in ((6, 6), (0, 0), (11, 11), (0, 6), (11, 0)):
        z = (np.mean(images[:, row, col] ** 2) / sigma**2 - 1) / np.sqrt(2 / 2000)
        assert abs(z) < stats.norm.isf(LEVEL / 2 / 5)


@pytest.mark.parametrize("back_projections", [0, 1, 2])
def test_the_scene_is_that_of_the_perfect_image(back_projections):
    """Same generator, no noise: the shifted image is a perfect one seen by the detector.

    The half pixels have twice the spread, of which a detector pixel keeps half.
    """
    fine, _ = template()
    parameters = {"contrast": 0.7, "frame_counts": (4, 16), "nedt": 0.0}
    perfect = thermal_images(
        fine, rng=np.random.default_rng(9), target_spread=0.1, sea_spread=0.3, **parameters
    )
    shifted = shifted_images(
        fine,
        rng=np.random.default_rng(9),
        target_spread=0.05,
        sea_spread=0.15,
        back_projections=back_projections,
        **parameters,
    )
    crop = 1 + back_projections
    seen = recombine(detector_samples(perfect), back_projections=back_projections)
    np.testing.assert_array_equal(shifted[:, crop:-crop, crop:-crop], seen)
    assert shifted.shape == perfect.shape


def test_the_detector_sees_the_same_sea_with_and_without_super_resolution():
    """Variances of 100 x 100 detector pixels of either, against the spread asked for; z at 1e-3.

    Shift-and-add of pixels that overlap in half have its (3/4)^2; every third half pixel of the
    result shares nothing with the next.
    """
    quiet = {"contrast": 1.0, "frame_counts": (16,), "nedt": 0.0, "sea_spread": 0.3}
    rng = np.random.default_rng(24)
    (plain,) = thermal_images(np.zeros((100, 100), bool), rng=rng, **quiet)
    (shifted,) = shifted_images(np.zeros((300, 300), bool), rng=rng, **quiet)
    for pixels, share in ((plain, 1.0), (shifted[::3, ::3], 9 / 16)):
        z = (np.mean(pixels**2) / (share * 0.3**2) - 1) / np.sqrt(2 / pixels.size)
        assert abs(z) < stats.norm.isf(LEVEL / 2 / 2)


def test_frame_counts_are_prefixes_here_too():
    fine, _ = template()
    straight, shuffled = (
        shifted_images(fine, contrast=0.7, frame_counts=counts, rng=np.random.default_rng(3))
        for counts in ((4, 16), (16, 4, 16))
    )
    np.testing.assert_array_equal(shuffled, straight[[1, 0, 1]])


def test_a_window_of_one_pixel():
    images = shifted_images(
        np.ones((1, 1), bool), contrast=1.0, frame_counts=(4,), rng=np.random.default_rng(0)
    )
    assert images.shape == (1, 1, 1)
    # A half pixel of ship on the sea: each detector pixel is a quarter of it.
    quiet = shifted_images(
        np.ones((1, 1), bool),
        contrast=1.0,
        frame_counts=(4,),
        rng=np.random.default_rng(0),
        nedt=0.0,
        target_spread=0.0,
        sea_spread=0.0,
    )
    assert quiet.item() == 0.25


def test_enlarged_images_repeat_their_pixels():
    image = np.arange(6.0).reshape(1, 2, 3)
    ours = enlarge(image)
    assert ours.shape == (1, 4, 6)
    for dy in (0, 1):
        for dx in (0, 1):
            np.testing.assert_array_equal(ours[:, dy::2, dx::2], image)


@settings(max_examples=30, deadline=None)
@given(back_projections=st.integers(0, 5), rows=st.integers(1, 9), cols=st.integers(1, 9))
def test_windows_keep_their_shape(back_projections, rows, cols):
    images = shifted_images(
        np.ones((rows, cols), bool),
        contrast=1.0,
        frame_counts=(1, 2),
        rng=np.random.default_rng(0),
        back_projections=back_projections,
    )
    assert images.shape == (2, rows, cols)
    assert np.isfinite(images).all()


def nothing_shifted(shape=(3, 4), **parameters):
    good = {"contrast": 1.0, "frame_counts": (4,), "rng": np.random.default_rng(0)}
    return shifted_images(np.zeros(shape, bool), **good | parameters)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: recombine(np.zeros((9, 9)), back_projections=-1), "back_projections is -1"),
        (lambda: recombine(np.zeros((9, 9)), back_projections=1.5), "back_projections is 1.5"),
        (lambda: recombine(np.zeros((3, 9)), back_projections=1), "samples .* at least 4 by 4"),
        (lambda: recombine(np.zeros(9)), "samples has shape"),
        (lambda: detector_samples(np.zeros((1, 9))), "fine has shape"),
        (lambda: back_project(np.ones(3)), r"samples has shape \(3,\)"),
        (lambda: back_project(np.ones((2, 0))), r"samples has shape \(2, 0\)"),
        (lambda: enlarge(3.0), r"image has shape \(\)"),
        (lambda: nothing_shifted((0, 0)), r"fine_target has shape \(0, 0\)"),
        (lambda: nothing_shifted((2, 3, 4)), r"fine_target has shape \(2, 3, 4\)"),
        (lambda: nothing_shifted(rng=None), "rng is None"),
        (lambda: nothing_shifted(sea_spread=-0.1), "sea_spread is -0.1"),
        (lambda: nothing_shifted(target_spread=np.nan), "target_spread is nan"),
        (lambda: noise_gain(-1), "back_projections"),
        (lambda: scene_gain(0.5), "back_projections"),
        (
            lambda: reconstruction_error(np.zeros((2, 2)), np.zeros((2, 2)), contrast=0.0),
            "contrast is 0",
        ),
        (
            lambda: reconstruction_error(np.ones((2, 2)), np.zeros((2, 2)), contrast=1e-300),
            "contrast is 1e-300, .* at least 1e-30",
        ),
        (
            lambda: reconstruction_error(np.ones((0, 0)), np.zeros((0, 0)), contrast=1.0),
            r"image has shape \(0, 0\)",
        ),
        (
            lambda: reconstruction_error(np.zeros((2, 3)), np.zeros((2, 2)), contrast=1.0),
            "image has shape",
        ),
    ],
)
def test_nonsense_is_named(call, named):
    with pytest.raises(ValueError, match=f"^{named}"):
        call()
