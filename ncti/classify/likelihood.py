"""Maximum likelihood from exact moments: what the best classifier of averaged frames can do."""

from __future__ import annotations

import math
from copy import copy
from numbers import Real
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import LinAlgError, cholesky_banded
from sklearn.base import BaseEstimator, _fit_context
from sklearn.utils._param_validation import Interval
from sklearn.utils.validation import check_is_fitted

from ncti.checks import require_all
from ncti.classify.bands import (
    checked_averages,
    checked_moments,
    densities,
    mean_correlation,
    residual_band,
    whiten,
)
from ncti.classify.between import cells
from ncti.classify.calibration import UNKNOWN_ERROR, calibrated_error
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
    template_error : float or None, default=0
        Variance of what lies between templates, over the square of the residual's scale (see
        `ncti.classify.between.cells`). At 0 templates are taken as exact, and as all there is:
        aspects between them do not exist. With None it is calibrated on templates left out.

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
    template_error_ : float
        As given, or as calibrated.

    Notes
    -----
    An average y of N frames of a template with mean m, floor f and one-frame covariance C is
    taken as

        y = m + (a - 1) (m - f) + b + e,   e ~ N(0, (C + nugget v I) / N),
        a ~ N(1, gain_sigma^2),   b ~ N(0, floor_sigma^2 v) in all bins,

    v the mean of all templates' variances. Gain and shift are integrated out: they add a matrix
    of low rank to the covariance, whose inverse and determinant follow from those of C / N by
    the Woodbury identity and the matrix determinant lemma. C is held at the nominal gain,
    though the target's speckle grows with it.

    Profiles are seen between the aspects of templates, too. With a template error k the average
    has two terms more, x t + r: t the tangent at the template times the standard deviation of the
    aspect within its cell, x ~ N(0, 1), and r ~ N(0, k R), R of the residual's scale in each bin
    and correlated between bins as noise is. Both are the same in all frames, so that R counts N
    times against C. x joins gain and floor. k is calibrated: every other template is left out, an
    average of 16 frames is drawn of each, and k makes their density under the templates beside it
    largest. Those left out lie at the edge of a cell, others within: k is rather too large.

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
        "template_error": [Interval(Real, 0, WIDEST, closed="both"), None],
    }

    def __init__(
        self,
        *,
        gain_sigma: float = 1.0,
        floor_sigma: float = 1.0,
        nugget: float = 1e-3,
        template_error: float | None = 0.0,
    ) -> None:
        self.gain_sigma = gain_sigma
        self.floor_sigma = floor_sigma
        self.nugget = nugget
        self.template_error = template_error

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(
        self,
        mean: ArrayLike,
        covariance: ArrayLike,
        labels: ArrayLike,
        floor: ArrayLike = 0.0,
        *,
        aspect: ArrayLike | None = None,
        rng: np.random.Generator | None = None,
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
        aspect : (template,) array_like, optional
            Where each template was taken [degree], distinct among those of a label; needed with
            a template error.
        rng : numpy.random.Generator, optional
            Draws the averages that a template error is calibrated on; needed for that.

        Returns
        -------
        GaussianTemplates
            Itself, fitted.

        Raises
        ------
        ValueError
            If shapes do not match, an element is not finite, a covariance is not positive
            definite with its nugget, or aspects or a generator are missing or not distinct.
        """
        means, bands, names, signal = checked_moments(mean, covariance, labels, floor)
        self.classes_, self.labels_ = np.unique(names, return_inverse=True)
        self.mean_ = means
        variance = float(bands[:, 0].mean())
        self._whole = bands.copy()
        self._whole[:, 0] += self.nugget * variance
        self.cholesky_ = np.empty_like(bands)
        # Directions of a unit of gain and of the floor's prior: what the likelihood takes of them
        # is whitened, all at once where templates are exact.
        shift = np.full_like(signal, math.sqrt(variance))
        self._directions = np.stack([signal, shift], axis=2)
        for t, band in enumerate(self._whole):
            try:
                self.cholesky_[t] = cholesky_banded(band, lower=True)
            except LinAlgError:
                raise ValueError(
                    f"nugget is {self.nugget!r}, but must be larger for covariance[{t}], which is "
                    "not positive definite with it"
                ) from None
        self._nuisance = np.stack(
            [whiten(*pair) for pair in zip(self.cholesky_, self._directions, strict=True)]
        )
        self._correlation = mean_correlation(self._whole)
        self.template_error_ = 0.0
        if self.template_error != 0:
            if aspect is None:
                raise ValueError("aspect is None, but a template error needs one a template")
            self.aspect_ = require_all("aspect", aspect)
            if self.template_error is None:
                if rng is None:
                    raise ValueError("rng is None, but a template error is calibrated on draws")
                self.template_error_ = UNKNOWN_ERROR
                self._find_cells()
                self.template_error_ = calibrated_error(self, rng)
            else:
                self.template_error_ = float(self.template_error)
            self._find_cells()
        return self

    def without(self, left_out: ArrayLike) -> Self:
        """Return the classifier of the other templates, as if some had never been taken.

        Parameters
        ----------
        left_out : (template,) array_like of bool
            Which go. Where templates may be off, cells of their neighbours become wider.

        Returns
        -------
        GaussianTemplates
            Another, fitted, of the same template error and the same mean variance.

        Raises
        ------
        ValueError
            If shapes do not match, or no template would be left.
        """
        check_is_fitted(self)
        out = np.asarray(left_out, dtype=bool)
        if out.shape != self.labels_.shape or out.all():
            raise ValueError(
                f"left_out has shape {out.shape} and leaves out {out.sum()}, but must have one for "
                f"each of {len(self.labels_)} templates and leave one"
            )
        rest = copy(self)
        kept = ["labels_", "mean_", "cholesky_", "_whole", "_nuisance", "_directions"]
        if self.template_error_:
            kept.append("aspect_")
        for name in kept:
            setattr(rest, name, getattr(self, name)[~out])
        if rest.template_error_:
            rest._find_cells()
        return rest

    def _find_cells(self) -> None:
        """Add what lies between templates to the directions that are unknown."""
        cell = cells(self.mean_, self.labels_, self.aspect_, self._correlation)
        known = self._directions[..., :2]
        self._directions = np.concatenate([known, cell.tangent[..., None]], axis=2)
        self._residual = cell.residual

    def log_likelihood(
        self,
        X: ArrayLike,
        frame_count: ArrayLike,
        *,
        gain_sigma: ArrayLike | None = None,
        floor_sigma: ArrayLike | None = None,
    ) -> Floats:
        """Logarithm of the density of each average under each template.

        Parameters
        ----------
        X : (sample, bin) array_like
            Averages of frames, noise floor included.
        frame_count : int or (sample,) array_like
            Frames in each average.
        gain_sigma, floor_sigma : (...) array_like, optional
            Prior standard deviations of gain and floor to take, one pair after the other, in
            place of the classifier's own: they share the whitening of X, which is most of the
            work. Their shapes are broadcast.

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
        priors = {"gain_sigma": gain_sigma, "floor_sigma": floor_sigma}
        found: Floats = self.compare(X, frame_count, **priors)[0]
        return found

    def compare(
        self,
        X: ArrayLike,
        frame_count: ArrayLike,
        *,
        gain_sigma: ArrayLike | None = None,
        floor_sigma: ArrayLike | None = None,
    ) -> Floats:
        """Log density of each average under each template, and its squared distance.

        Parameters and errors are those of `log_likelihood`.

        Returns
        -------
        (2, ..., sample, template) float64 ndarray
            Natural logarithms, and squared Mahalanobis distances by the covariance with all
            unknowns integrated out: chi-square with as many degrees of freedom as bins for
            averages of a template's own, unknowns drawn from their priors.
        """
        check_is_fitted(self)
        samples, frames = checked_averages(X, frame_count, self.mean_.shape[1])
        given = {"gain_sigma": gain_sigma, "floor_sigma": floor_sigma}
        priors = np.broadcast_arrays(
            *(
                require_all(
                    name, getattr(self, name) if one is None else one, minimum=0, maximum=WIDEST
                )
                for name, one in given.items()
            )
        )
        pairs = np.stack([one.ravel() for one in priors], axis=1)
        result = np.empty((2, len(pairs), len(samples), len(self.mean_)))
        with np.errstate(over="ignore", invalid="ignore"):
            for t in range(len(self.mean_)):
                # What is the same in all frames counts once for each of them: templates that may
                # be off have a factor for every number of frames.
                for count in np.unique(frames) if self.template_error_ else (None,):
                    rows = slice(None) if count is None else frames == count
                    result[..., rows, t] = self.density(t, samples[rows], frames[rows], pairs)
        if not np.isfinite(result).all():
            raise ValueError(
                f"X reaches {np.abs(samples).max():g}, but its squared distance to the templates "
                "must be a finite number"
            )
        return result.reshape(2, *priors[0].shape, len(samples), -1)

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

    def density(self, template: int, samples: Floats, frames: Floats, priors: Floats) -> Floats:
        """See `ncti.classify.bands.densities`; as many frames in all where templates may be off."""
        factor, unit = self._whitened(template, float(frames[0]))
        return densities(factor, unit, samples - self.mean_[template], frames, priors)

    def _whitened(self, template: int, frames: float) -> tuple[Floats, Floats]:
        """Factor of a frame's covariance, and the unknowns' directions whitened by it."""
        if not self.template_error_:
            return self.cholesky_[template], self._nuisance[template]
        scale = math.sqrt(frames * self.template_error_) * self._residual[template]
        whole = self._whole[template] + residual_band(scale, self._correlation)
        factor = cholesky_banded(whole, lower=True)
        return factor, whiten(factor, self._directions[template])
