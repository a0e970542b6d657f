"""Robust fit of the place of a truth to an image, for the tilts of corrected images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ncti.irar.seen import Looks, Truth

_TUKEY = 4.685  # standard deviations; 95 % efficient for normal errors
# Stages of the fit: noise floor as a share of the ship's brightness, most passes, and the step at
# which a stage has converged [pixel, or pixels a pixel].
_STAGES = (
    *((floor, 4, 1e-4) for floor in (1.0, 0.5, 0.25, 0.12, 0.06)),
    (0.03, 25, 1e-5),
)
_MIN_PIXELS = 8  # of the ship in each channel
# Affine map from image to truth: shift up and right [pixel], columns a row (mast), rows a column
# (waterline), rows a row and columns a column [pixels a pixel]. Its value for a perfect image, and
# the largest change in one pass.
START = (0.0, 0.0, 0.0, 0.0, 1.0, 1.0)
_STEP = (1.0, 1.0, 0.1, 0.1, 0.02, 0.02)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class _Estimate:
    """Parameters of a fit: the truth's place, and gain, offset and scatter of each channel."""

    place: Floats  # (6,), see `START`
    gain: Floats
    offset: Floats
    scatter: Floats

    def step(self, change: Floats, scatter: Floats) -> tuple[_Estimate, float]:
        """Return the estimate after a step of at most `_STEP`, and the step's largest component."""
        channels = len(self.gain)
        step = np.clip(change[:6], np.negative(_STEP), _STEP)
        gain = np.clip(self.gain + change[6 : 6 + channels], 0.2, 5.0)
        offset = np.clip(self.offset + change[6 + channels :], -0.5, 0.5)
        return _Estimate(self.place + step, gain, offset, scatter), float(np.abs(step).max())


def fit_place(
    observed: Floats,
    known: NDArray[np.bool_],
    view: Truth,
    looks: Looks,
    place: Floats,
    min_scatter: float,
) -> tuple[Floats, Floats] | None:
    """Return the place of a truth in an image (6,), by robust least squares, and its covariance.

    `observed` (channel, row, column) is in units of the ship's brightness, `known` masks the pixels
    to fit; `place` (6,) is the start, as of `START`; `min_scatter` is in shares of the model.
    Returns None if a channel shows too little of the ship. Gauss-Newton steps with Tukey's
    biweight; the noise floor falls in stages, since with a high floor every residual is an inlier
    while the start is still wrong.
    """
    channels = len(observed)
    fit = _Estimate(place, np.ones(channels), np.zeros(channels), np.ones(channels))
    covariance = np.full((6, 6), np.nan)
    for floor, passes, smallest_step in _STAGES:
        for _ in range(passes):
            model, slopes = view.image(fit.place, looks)
            if (((model > 0) & known).sum(axis=(1, 2)) < _MIN_PIXELS).any():
                return None
            # One linear system for all channels: they share the place, not gain and offset.
            design, misfit, scatter = zip(
                *(
                    _build_equations(
                        fit, c, observed[c], known[c], model[c], slopes[c], floor, min_scatter
                    )
                    for c in range(channels)
                ),
                strict=True,
            )
            terms = np.concatenate(design)
            inverse = np.linalg.pinv(terms.T @ terms, hermitian=True)
            change = inverse @ (terms.T @ np.concatenate(misfit))
            fit, step = fit.step(change, np.array(scatter))
            covariance = inverse[:6, :6]
            if step < smallest_step:
                break
    return fit.place, covariance


def _build_equations(
    fit: _Estimate,
    channel: int,
    observed: Floats,
    known: NDArray[np.bool_],
    model: Floats,
    slopes: Floats,
    floor: float,
    min_scatter: float,
) -> tuple[Floats, Floats, float]:
    """Return the weighted linear equations of one channel, and its new scatter.

    Terms are (pixel, 6 + 2 channels): derivatives by place, then by gains and offsets. The misfit
    is (pixel,).
    """
    gain, offset, channels = fit.gain[channel], fit.offset[channel], len(fit.gain)
    residual = observed - gain * model - offset

    # Standard deviation up to a factor, the scatter: speckle grows with the model, noise does not.
    is_dark = (model == 0) & known
    around = 1.4826 * np.median(np.abs(residual[is_dark])) if is_dark.any() else 0.0
    noise = max(floor, around / fit.scatter[channel])
    spread = np.maximum(gain * model + offset, 0.0) + noise
    # The scatter is that of the median residual of the ship's brighter pixels.
    is_bright = (model > model.max() / 5) & known
    scatter = max(1.4826 * float(np.median(np.abs((residual / spread)[is_bright]))), min_scatter)

    # Tukey's biweight leaves out residuals beyond `_TUKEY` standard deviations.
    unit = residual / (spread * scatter)
    weight = np.maximum(1.0 - (unit / _TUKEY) ** 2, 0.0) * known
    terms = np.zeros((*model.shape, 6 + 2 * channels))
    terms[..., :6] = gain * slopes
    terms[..., 6 + channel], terms[..., 6 + channels + channel] = model, 1.0
    terms *= (weight / spread / scatter)[..., None]
    return terms.reshape(-1, terms.shape[-1]), (unit * weight).ravel(), scatter
