"""Maximum likelihood from exact moments: what the best classifier of averaged frames can do."""

from __future__ import annotations

import math
from numbers import Real
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import LinAlgError, cholesky_banded
from scipy.linalg.lapack import dtbtrs
from sklearn.base import BaseEstimator, _fit_context
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import check_is_fitted

from ncti.checks import require_all
from ncti.classify.fusion import label_posterior

WIDEST = 1e6  # of any prior: flat beside what a profile tells, and its square no problem

Floats = NDArray[np.float64]


class GaussianTemplates(BaseEstimator):
    """Classify averages of frames by their likelihood under each template's mean and covariance.

    Parameters
    ----------
    gain_sigma : float, default=1.0
        Prior standard deviation of the target's amplitude gain about its nominal 1. At 0 the
        gain is known.
    floor_sigma : float, default=1.0
        Prior standard deviation of a shift of the noise floor, the same in all bins, in units of
        the templates' root-mean-square deviation of one frame. At 0 the floor is known.
    nugget : float, default=1e-3
        Variance of independent noise in every bin of one frame, over the templates' mean
        variance.

    Attributes
    ----------
    classes_ : (class,) ndarray
        The labels of the templates.
    labels_ : (template,) intp ndarray
        Class of each template.
    mean_ : (template, bin) float64 ndarray
        Mean of a frame.
    cholesky_ : (template, lag, bin) float64 ndarray
        Lower Cholesky factor of one frame's covariance, nugget included, as a lower band.

    Notes
    -----
    An average y of N frames of a template with mean m, floor f and one-frame covariance C is
    taken as

        y = m + (a - 1) (m - f) + b + e,   e ~ N(0, (C + nugget v I) / N),
        a ~ N(1, gain_sigma^2),   b ~ N(0, floor_sigma^2 v) in all bins,

    v the mean of all templates' variances. Gain and shift are integrated out: they add a matrix
    of rank two to the covariance, whose inverse and determinant follow from those of C / N by
    the Woodbury identity and the matrix determinant lemma. C is held at the nominal gain,
    though the target's speckle grows with it.

    The defaults know neither gain nor floor, like a profile vector, whose floor is removed and
    whose peak is 1; both priors are then wide beside what the profile itself tells. At 0 the
    classifier knows what a calibration would have to tell. Beware of a known floor where frames
    accumulate a fixed number of target-free IFOVs besides the ship's: it counts the ship's IFOVs.

    The matched filter limits the band of the field, not of its magnitude, whose products fill
    the spectrum: the smallest eigenvalue of C, over a bin's variance, is 2e-3 at 30 ns, 3e-4 at
    50 ns and 5e-7 at 200 ns (bins of 1 m). The nugget stands for electronics and rounding after
    the detector, 30 dB below a bin's own noise; at 30 ns scores are the same within half a point
    from 1e-7 to 1e-1, and it keeps longer pulses from resting on digits that nobody records.

    A sum of magnitudes is skewed by 0.63 over the square root of their number, IFOVs times N.
    From some 100 on probabilities are those of sampled frames; with 32 they are a point too
    sure, with 2 three points (three labels alike, 40 % right).
    """

    _parameter_constraints: ClassVar[dict] = {
        "gain_sigma": [Interval(Real, 0, WIDEST, closed="both")],
        "floor_sigma": [Interval(Real, 0, WIDEST, closed="both")],
        "nugget": [Interval(Real, 0, WIDEST, closed="both")],
    }

    def __init__(
        self, *, gain_sigma: float = 1.0, floor_sigma: float = 1.0, nugget: float = 1e-3
    ) -> None:
        self.gain_sigma = gain_sigma
        self.floor_sigma = floor_sigma
        self.nugget = nugget

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(
        self, mean: ArrayLike, covariance: ArrayLike, labels: ArrayLike, floor: ArrayLike = 0.0
    ) -> Self:
        """Take the templates.

        Parameters
        ----------
        mean : (template, bin) array_like
            Mean frame of each template, noise floor included.
        covariance : (template, lag, bin) array_like
            Covariance of *one* frame of each template as a lower band: element [t, l, n] is that
            of bins n and n + l. `lower_band` makes it from a dense one.
        labels : (template,) array_like
            What a template stands for, such as a ship; many may share a label.
        floor : array_like, default=0.0
            Noise floor within `mean`, which no target gain changes: one number, (bin,),
            (template, 1) or (template, bin).

        Returns
        -------
        GaussianTemplates
            Itself, fitted.

        Raises
        ------
        ValueError
            If shapes do not match, an element is not finite, or a covariance is not positive
            definite with its nugget.
        """
        means = require_all("mean", mean)
        bands = require_all("covariance", covariance)
        if means.ndim != 2 or not means.size:
            raise ValueError(f"mean has shape {means.shape}, but must be (template, bin)")
        count, bins = means.shape
        lags = bands.shape[1] if bands.ndim == 3 else 0
        if bands.shape != (count, lags, bins) or not 1 <= lags <= bins:
            raise ValueError(
                f"covariance has shape {bands.shape}, but must be ({count}, lag, {bins}) with 1 "
                f"to {bins} lags"
            )
        names = np.asarray(labels)
        if names.shape != (count,):
            raise ValueError(f"labels has shape {names.shape}, but must be ({count},)")
        try:
            signal = means - require_all("floor", floor)
        except ValueError as error:
            if "broadcast" not in str(error):
                raise
            signal = np.empty(0)
        if signal.shape != means.shape:
            raise ValueError(
                f"floor has shape {np.shape(floor)}, but must be one number, ({bins},), "
                f"({count}, 1) or {means.shape}"
            )
        self.classes_, self.labels_ = np.unique(names, return_inverse=True)
        self.mean_ = means
        variance = float(bands[:, 0].mean())
        self.cholesky_ = np.empty_like(bands)
        # Directions of a unit of gain and of the floor's prior, whitened: all that the likelihood
        # takes of them.
        self._nuisance = np.empty((count, bins, 2))
        for t, band in enumerate(bands):
            whole = band.copy()
            whole[0] += self.nugget * variance
            try:
                self.cholesky_[t] = cholesky_banded(whole, lower=True)
            except LinAlgError:
                raise ValueError(
                    f"nugget is {self.nugget!r}, but must be larger for covariance[{t}], which is "
                    "not positive definite with it"
                ) from None
            shift = np.full(bins, self.floor_sigma * math.sqrt(variance))
            self._nuisance[t] = _whiten(self.cholesky_[t], np.stack([signal[t], shift], axis=1))
        return self

    def log_likelihood(
        self, X: ArrayLike, frame_count: ArrayLike, *, gain_sigma: ArrayLike | None = None
    ) -> Floats:
        """Logarithm of the density of each average under each template.

        Parameters
        ----------
        X : (sample, bin) array_like
            Averages of frames, noise floor included.
        frame_count : int or (sample,) array_like
            Frames in each average.
        gain_sigma : (...) array_like, optional
            Prior standard deviations of the gain to take, one after the other, in place of the
            classifier's own: they share the whitening of X, which is most of the work.

        Returns
        -------
        (..., sample, template) float64 ndarray
            Natural logarithm of the density.

        Raises
        ------
        ValueError
            If X is empty, has another number of bins or an element that is not finite or whose
            square overflows, a count is below 1, or a deviation is out of range.
        """
        check_is_fitted(self)
        samples = require_all("X", X)
        bins = self.mean_.shape[1]
        # LAPACK's band solver writes beyond its arrays when there is nothing to solve.
        if samples.ndim != 2 or samples.shape[1] != bins or not samples.size:
            raise ValueError(
                f"X has shape {samples.shape}, but must be (sample, {bins}) with a sample or more"
            )
        frames = require_all("frame_count", frame_count, minimum=1)
        if frames.shape not in ((), (len(samples),)):
            raise ValueError(
                f"frame_count has shape {frames.shape}, but must be one number or ({len(samples)},)"
            )
        gains = require_all(
            "gain_sigma",
            self.gain_sigma if gain_sigma is None else gain_sigma,
            minimum=0,
            maximum=WIDEST,
        )
        n = np.broadcast_to(frames, len(samples))
        result = np.empty((gains.size, len(samples), len(self.mean_)))
        with np.errstate(over="ignore", invalid="ignore"):
            for t in range(len(self.mean_)):
                result[:, :, t] = self._log_density(t, samples, n, gains.ravel())
        if not np.isfinite(result).all():
            raise ValueError(
                f"X reaches {np.abs(samples).max():g}, but its squared distance to the templates "
                "must be a finite number"
            )
        return result.reshape(*gains.shape, len(samples), -1)

    def posterior(
        self, X: ArrayLike, frame_count: ArrayLike, *, exclude: ArrayLike = False
    ) -> Floats:
        """Probability of each label.

        Parameters
        ----------
        X, frame_count
            As for `log_likelihood`.
        exclude : (sample, template) or (template,) array_like of bool, default=False
            Templates that do not answer for a sample, such as the one it was drawn from.

        Returns
        -------
        (sample, class) float64 ndarray
            Rows sum to 1. Labels are equally likely beforehand, and so are the templates of a
            label that answer; a label without any has probability 0.

        Raises
        ------
        ValueError
            As for `log_likelihood`, or if all templates of a sample are left out.
        """
        return self.posterior_of(self.log_likelihood(X, frame_count), exclude=exclude)

    def posterior_of(self, logs: ArrayLike, *, exclude: ArrayLike = False) -> Floats:
        """Probability of each label from `log_likelihood`, which several questions may share.

        Parameters
        ----------
        logs : (sample, template) array_like
            Logarithms of the density under each template, up to a number a sample.
        exclude
            As for `posterior`.

        Returns
        -------
        (sample, class) float64 ndarray
            As of `posterior`.

        Raises
        ------
        ValueError
            As `ncti.classify.label_posterior`, whose rule this is.
        """
        check_is_fitted(self)
        return label_posterior(require_all("logs", logs), self.labels_, exclude=exclude)[1]

    def predict(
        self, X: ArrayLike, frame_count: ArrayLike, *, exclude: ArrayLike = False
    ) -> NDArray:
        """Most probable label of each average.

        Parameters
        ----------
        X, frame_count, exclude
            As for `posterior`.

        Returns
        -------
        (sample,) ndarray
            Labels; of equally probable ones the first in `classes_`.
        """
        answer = self.posterior(X, frame_count, exclude=exclude).argmax(axis=1)
        return self.classes_[answer]

    def _log_density(self, template: int, samples: Floats, frames: Floats, gains: Floats) -> Floats:
        """(gain, sample) float64 ndarray: that of averages of (sample,) frames of one template.

        With U, the whitened prior directions of gain and floor, the covariance of n frames is
        L (I + n U U') L' / n: the lemmas need the 2 x 2 matrix I + n U'U alone. A gain's
        deviation only scales the first direction.
        """
        factor, unit = self.cholesky_[template], self._nuisance[template]
        white = _whiten(factor, (samples - self.mean_[template]).T)
        alone = frames * np.einsum("bs,bs->s", white, white)
        alone += 2 * np.log(factor[0]).sum() + len(white) * np.log(2 * math.pi / frames)
        gram, along = unit.T @ unit, (unit.T @ white).T
        density: Floats = np.empty((len(gains), len(samples)))
        for k, gain in enumerate(gains):
            scale = np.array([gain, 1.0])
            inner = np.eye(2) + frames[:, None, None] * (gram * np.outer(scale, scale))
            overlap = frames[:, None] * (along * scale)
            known = np.sum(overlap * np.linalg.solve(inner, overlap[..., None])[..., 0], axis=1)
            density[k] = -(alone - known + np.linalg.slogdet(inner).logabsdet) / 2
        return density


def lower_band(covariance: ArrayLike) -> Floats:
    """Dense symmetric matrices as lower bands of all their lags.

    Parameters
    ----------
    covariance : (..., bin, bin) array_like
        Symmetric; only the lower triangle is read.

    Returns
    -------
    (..., lag, bin) float64 ndarray
        As `scipy.linalg.cholesky_banded` takes it: element [l, n] is that of bins n + l and n,
        zero where n + l is no bin.
    """
    dense = np.asarray(covariance, dtype=np.float64)
    bins = dense.shape[-1]
    if dense.ndim < 2 or dense.shape[-2] != bins:
        raise ValueError(f"covariance has shape {dense.shape}, but must be (..., bin, bin)")
    lag, n = np.mgrid[:bins, :bins]
    inside = lag + n < bins
    return np.where(inside, dense[..., np.where(inside, lag + n, 0), n], 0.0)


def _whiten(factor: Floats, columns: Floats) -> Floats:
    """L^-1 times (bin, column) columns, L a lower band."""
    white, _ = dtbtrs(factor, columns, uplo="L")
    return white
