"""Super-resolution from frames shifted by half a pixel, recombined on the half-pixel grid."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_generator
from ncti.infrared.radiometry import NEDT, SPREAD
from ncti.infrared.scene import draw_scene

BACK_PROJECTIONS = 0
"""Iterations after shift-and-add: none.

Root-mean-square error against the fine template over the contrast, expected (closed form) over
the article's four ships at 0, 45 and 90 deg, two phases, windows with 4 half pixels of sea, a
spread of 0.1 K:

=====  ======  =====  =======  =============  =====  =====  =====  =======
 km    frames  none   perfect  shift-and-add  1      2      3      quarter
=====  ======  =====  =======  =============  =====  =====  =====  =======
 25      4     0.264   0.174       0.149      0.166  0.185  0.201   0.201
 25     16     0.227   0.110       0.132      0.133  0.140  0.146   0.149
 25     64     0.216   0.087       0.128      0.124  0.126  0.129   0.132
 50      4     0.362   0.294       0.202      0.252  0.291  0.322   0.305
 50     16     0.282   0.186       0.167      0.189  0.208  0.223   0.202
 50     64     0.257   0.147       0.158      0.169  0.181  0.191   0.167
100      4     0.852   0.832       0.480      0.665  0.790  0.886   0.804
100     16     0.556   0.526       0.356      0.469  0.542  0.595   0.480
100     64     0.453   0.416       0.317      0.406  0.459  0.496   0.356
=====  ======  =====  =======  =============  =====  =====  =====  =======

The frames are those of each position; `quarter` is shift-and-add with a quarter of them there,
which makes as many in all as `none` and `perfect` have. The noise that an iteration adds, and the
sea's own pattern that it sharpens, cost more than the blur that it removes, but at 25 km with 64
frames: shift-and-add is best in eight cells of nine and never more than 4 % above the best; one
iteration is up to 39 % above it. With a quarter of the frames it still is better than `none`
everywhere, and than `perfect` at 100 km. `perfect` is no bound: it has the spread of a detector
pixel in every half pixel. `tests/infrared/test_super_resolution.py` computes the table.
"""

LEAST_CONTRAST = 1e-30
"""Least contrast that an error may be a fraction of [K]: none that a sensor sees, yet errors of
any scene over it are numbers that a float32 still holds."""


def detector_samples(fine: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the detector sees of a fine scene from the four half-pixel positions.

    Parameters
    ----------
    fine : (..., row, col) float64 array_like
        Scene on the half-pixel grid [K], at least 2 by 2.

    Returns
    -------
    (..., row - 1, col - 1) float64 ndarray
        The four images interlaced [K]: `[..., dy::2, dx::2]` is the one of the detector moved by
        (dx, dy) half pixels. Only pixels that lie whole in the scene.

    Raises
    ------
    ValueError
        If the scene is smaller than a pixel.

    Notes
    -----
    A detector pixel averages the 2 x 2 half pixels that it covers, B x; over all four positions
    that is a moving average. Its response cos(u/2) cos(v/2) is zero where a pattern alternates
    from half pixel to half pixel: what the article calls an algebraic subdivision exists without
    noise, given a known rim, and amplifies noise without bound.
    """
    fine = _image("fine", fine, least=2)
    pairs = fine[..., :-1] + fine[..., 1:]
    return (pairs[..., :-1, :] + pairs[..., 1:, :]) / 4


def back_project(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """Adjoint of `detector_samples`: a quarter of the sum of the pixels that cover a half pixel.

    Parameters
    ----------
    samples : (..., row - 1, col - 1) float64 array_like
        Interlaced detector images [K].

    Returns
    -------
    (..., row, col) float64 ndarray
        On the half-pixel grid [K]. Four pixels cover a half pixel, on the border fewer.

    Raises
    ------
    ValueError
        If there is no sample.

    Notes
    -----
    B^T y. Where all four exist it is their mean: shift-and-add.
    """
    samples = _image("samples", samples)
    fine = np.zeros((*samples.shape[:-2], samples.shape[-2] + 1, samples.shape[-1] + 1))
    for rows in (slice(None, -1), slice(1, None)):
        for cols in (slice(None, -1), slice(1, None)):
            fine[..., rows, cols] += samples
    return fine / 4


def recombine(
    samples: NDArray[np.float64], *, back_projections: int = BACK_PROJECTIONS
) -> NDArray[np.float64]:
    """The fine image that four shifted detector images tell.

    Parameters
    ----------
    samples : (..., row, col) float64 array_like
        Interlaced detector images, as from `detector_samples` [K].
    back_projections : int
        Iterations n after shift-and-add.

    Returns
    -------
    (..., row - 1 - 2 n, col - 1 - 2 n) float64 ndarray
        Fine image [K], without the rim that samples from beyond the border would change.

    Raises
    ------
    ValueError
        If the number is not a whole one of at least 0, or the samples are all rim: fewer than
        2 (1 + n) on a side.

    Notes
    -----
    Shift-and-add is B^T y (Elad and Hel-Or 2001, doi:10.1109/83.935034; Farsiu et al. 2004,
    doi:10.1109/TIP.2004.834669): for frames of equal noise, shifted by a whole number of fine
    pixels. Back-projection repeats x += B^T (y - B x) (Irani and Peleg 1991,
    doi:10.1016/1049-9652(91)90045-L). No eigenvalue of B^T B exceeds 1, so a step of 1 converges
    monotonically, fast where a pattern is coarse and not at all where B is blind.
    """
    count = _whole(back_projections)
    crop = 1 + count
    samples = _image("samples", samples, least=2 * crop)
    if count == 0:
        # Nothing of the rim is needed: the four in the order in which `back_project` adds them.
        fine = samples[..., 1:, 1:] + samples[..., 1:, :-1]
        fine += samples[..., :-1, 1:]
        fine += samples[..., :-1, :-1]
        fine /= 4
        return fine
    fine = back_project(samples)
    for _ in range(count):
        fine += back_project(samples - detector_samples(fine))
    return fine[..., crop:-crop, crop:-crop]


def shifted_images(
    fine_target: NDArray[np.bool_],
    *,
    contrast: float,
    frame_counts: Sequence[int] | NDArray[np.integer],
    rng: np.random.Generator,
    nedt: float = NEDT,
    target_spread: float = SPREAD,
    sea_spread: float = SPREAD,
    back_projections: int = BACK_PROJECTIONS,
) -> NDArray[np.float64]:
    """Images super-resolved from four half-pixel positions of the detector.

    Parameters
    ----------
    fine_target : (row, col) bool array_like
        True on the ship, on the half-pixel grid.
    contrast : float
        Mean temperature of the ship against the mean sea [K].
    frame_counts : (frame_count,) sequence of int
        Frames averaged *at each position*, in any order: four times as many in all. The image of
        one count does not depend on the others.
    rng : numpy.random.Generator
        Source of randomness, with a seed sequence as `numpy.random.default_rng` gives it.
    nedt : float
        Noise of one frame [K].
    target_spread, sea_spread : float
        Own standard deviation of ship and sea in a *detector pixel* [K], as in an image without
        super-resolution; that of a half pixel is twice as much.
    back_projections : int
        Iterations after shift-and-add.

    Returns
    -------
    (frame_count, row, col) float64 ndarray
        Temperature against the mean sea [K], on the grid of `fine_target`.

    Raises
    ------
    ValueError
        If a parameter is out of range, the target no image with at least one pixel, or the
        generator has no seed sequence.

    Notes
    -----
    Article, 'Passive-IR Signatures': frames shifted by half an IFOV in azimuth and elevation. It
    assumes their recombination perfect; here it is carried out (see `recombine`). Half pixels are
    independent, so the mean of the four in a detector pixel has half the spread of one: drawn with
    twice the spread, they are the same sea to the detector as without super-resolution. The scene
    is that of `ncti.infrared.thermal_images` with twice the spread, for the same generator bit for
    bit. The sea goes on beyond the window, far enough that the window's border is as good as its
    middle. A larger window changes no bit on the ship for up to three back-projections; with more,
    pixels at its outline reach beyond the sea that is drawn with it.
    """
    rim = 1 + _whole(back_projections)
    fine_target = _image("fine_target", fine_target, bool, axes=2)
    require_generator("rng", rng)
    require("target_spread", target_spread, minimum=0.0)
    require("sea_spread", sea_spread, minimum=0.0)
    scene, noise = draw_scene(
        fine_target,
        contrast=contrast,
        frame_counts=frame_counts,
        rng=rng,
        nedt=nedt,
        target_spread=2 * target_spread,
        sea_spread=2 * sea_spread,
        rim=rim,
    )
    # The noise drawn with a half pixel is that of the detector pixel with its lower left there.
    return recombine(
        detector_samples(scene) + noise[:, :-1, :-1], back_projections=back_projections
    )


def noise_gain(back_projections: int = BACK_PROJECTIONS) -> float:
    """Noise of the recombined image over the noise of one position's average.

    Parameters
    ----------
    back_projections : int
        Iterations after shift-and-add.

    Returns
    -------
    float
        Ratio of standard deviations; 0.5 for shift-and-add, the mean of four.

    Raises
    ------
    ValueError
        If the number is not a whole one of at least 0.

    Notes
    -----
    The root of the sum of squares of `recombine`'s response to one sample. Noise is white over
    the interlaced samples, and neighbours of the recombined image share it.
    """
    return _gains(_whole(back_projections))[0]


def scene_gain(back_projections: int = BACK_PROJECTIONS) -> float:
    """Own spread of the recombined image over that of a detector pixel.

    Parameters
    ----------
    back_projections : int
        Iterations after shift-and-add.

    Returns
    -------
    float
        Ratio of standard deviations, away from the ship's outline; 0.75 for shift-and-add.

    Raises
    ------
    ValueError
        If the number is not a whole one of at least 0.

    Notes
    -----
    As `noise_gain`, of the way from one half pixel of the scene through the detector to the image,
    times 2 because a half pixel has twice the spread of a detector pixel. For shift-and-add the
    weights are 1/4, 1/2, 1/4 both ways, whose squares sum to (3/8)^2. Within 1 + back_projections
    half pixels of the outline ship and sea mix.
    """
    return 2 * _gains(_whole(back_projections))[1]


@lru_cache
def _gains(count: int) -> tuple[float, float]:
    """Root sum of squares of the response to one sample, and to one half pixel of the scene."""
    # Responses reach 2 + n half pixels; of the field about them 1 + n are cropped.
    size = 4 * (2 + count) + 1
    impulse = np.zeros((size, size))
    impulse[size // 2, size // 2] = 1.0
    of_sample = recombine(impulse, back_projections=count)
    of_scene = recombine(detector_samples(impulse), back_projections=count)
    return float(np.linalg.norm(of_sample)), float(np.linalg.norm(of_scene))


def enlarge(image: NDArray[Any]) -> NDArray[Any]:
    """An image on the half-pixel grid without super-resolution: each pixel twice by twice.

    Parameters
    ----------
    image : (..., row, col) array_like
        Image at the detector's pixels, in any unit.

    Returns
    -------
    (..., 2 row, 2 col) ndarray
        The same values.

    Raises
    ------
    ValueError
        If there is no pixel.
    """
    return _image("image", image, None).repeat(2, axis=-2).repeat(2, axis=-1)


def reconstruction_error(
    image: NDArray[np.float64], fine_target: NDArray[np.bool_], *, contrast: float
) -> Any:
    """How far an image is from the noiseless template, as a fraction of the contrast.

    Parameters
    ----------
    image : (..., row, col) float64 array_like
        Temperature against the mean sea [K].
    fine_target : (row, col) bool array_like
        True on the ship.
    contrast : float
        Mean temperature of the ship against the mean sea [K], at least `LEAST_CONTRAST`.

    Returns
    -------
    float or (...) float64 ndarray
        Root-mean-square difference to target times contrast over the window, divided by the
        contrast.

    Raises
    ------
    ValueError
        If the contrast is too small or not finite, or the shapes differ or have no pixel.

    Notes
    -----
    Noise, the own spread of ship and sea, and blur all count. A wider window of sea lowers the
    share of the blur, so compare in the same window.
    """
    require("contrast", contrast, minimum=LEAST_CONTRAST)
    image, fine_target = _image("image", image), _image("fine_target", fine_target, bool, axes=2)
    if image.shape[-2:] != fine_target.shape:
        raise ValueError(
            f"image has shape {image.shape}, but must end in the target's {fine_target.shape}"
        )
    rms = np.sqrt(np.mean((image - contrast * fine_target) ** 2, axis=(-2, -1))) / contrast
    return float(rms) if rms.ndim == 0 else rms


def _whole(back_projections: int) -> int:
    """The number of back-projections, if it is one."""
    require("back_projections", back_projections, whole=True, minimum=0.0)
    return int(back_projections)


def _image(
    name: str, values: Any, dtype: Any = np.float64, *, least: int = 1, axes: int | None = None
) -> NDArray[Any]:
    """As an array of images, or of just one for two axes, with enough rows and columns."""
    images = np.asarray(values, dtype=dtype)
    if images.ndim < 2 or images.ndim != (axes or images.ndim) or min(images.shape[-2:]) < least:
        raise ValueError(
            f"{name} has shape {images.shape}, but must be "
            f"{'an image' if axes else 'images'} of at least {least} by {least} pixels"
        )
    return images
