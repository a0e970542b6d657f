"""Maximum likelihood from exact moments: the optimal classifier of averaged frames."""

from __future__ import annotations

import math
from copy import copy
from numbers import Real
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cholesky_banded
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from ncti.checks import require, require_all, require_flags, require_shape
from ncti.classify.bands import (
    checked_averages,
    checked_moments,
    cholesky_factors,
    colour,
    densities,
    mean_correlation,
    residual_band,
    whiten,
)
from ncti.classify.between import alternate_templates, cells
from ncti.classify.constraints import Interval, fit_context
from ncti.classify.fusion import label_posterior

UNCALIBRATED_ERROR = 1.0  # with too few templates to leave some out: the residual's full scale
CALIBRATION_FRAMES = 16  # frames in the averages used for calibration
ERROR_BOUNDS = 1e-4, 1e2  # bounds of the template error
MAX_PRIOR = 1e6  # of any prior: flat compared to the likelihood, with a finite square

Floats = NDArray[np.float64]


class GaussianTemplates(BaseEstimator):
    """Classify averages of frames by their likelihood under the mean and covariance of templates.

    Parameters
    ----------
    gain_sigma : float, default=1.0
        Prior standard deviation of the amplitude gain of the target about its nominal value 1. At
        0 the gain is known.
    floor_sigma : float, default=1.0
        Prior standard deviation of a shift of the noise floor, the same in all bins, in units of
        the root-mean-square standard deviation of one frame of the templates. At 0 the floor is
        known.
    diagonal_loading : float, default=1e-3
        Variance of independent noise in every bin of one frame, relative to the mean variance of
        the templates.
    template_error : float or None, default=0
        Variance of profiles between templates, relative to the square of the residual's scale
        (see `ncti.classify.between.cells`). At 0 templates are exact, and aspects between them are
        not considered. None calibrates it on templates that are left out.

    Attributes
    ----------
    classes_ : (class,) ndarray
        The labels of the templates.
    labels_ : (template,) intp ndarray
        Class of each template.
    mean_ : (template, place, bin) float64 ndarray
        Mean of a frame.
    cholesky_ : (template, lag, bin) float64 ndarray
        Lower Cholesky factor of the covariance of one frame, loading included, as a lower band.
    template_error_ : float
        As given, or as calibrated.

    See Also
    --------
    fuse : Combination with the scores of another sensor.
    ncti.ladar.banded_frame_moments : Mean and covariance of a frame.

    Notes
    -----
    An average y of N frames of a template with mean m, floor f and one-frame covariance C is
    modelled as

        y = m + (a - 1) (m - f) + b + e,   e ~ N(0, (C + l v I) / N),
        a ~ N(1, gain_sigma^2),   b ~ N(0, floor_sigma^2 v) in all bins,

    with v the mean variance of all templates. Gain and shift are integrated out: they add a matrix
    of low rank to the covariance, whose inverse and determinant follow from those of C / N by
    the Woodbury identity and the matrix determinant lemma. C is that of the nominal gain, although
    the speckle of the target grows with the gain.

    A template may have a mean for each of several places of the ship on the IFOVs, all equally
    probable: its density is the mean over them, each with its own floor and gain. Places share a
    covariance, since the variance of a bin depends on the power in it, however IFOVs divide the
    ship: for four ships at 100 km it varies by 0.04 % between places. An average is whitened once
    for all of them.

    With a template error k, profiles at aspects between templates are modelled by two more terms,
    x t + r: t the tangent at the template times the standard deviation of the aspect within its
    cell, x ~ N(0, 1), and r ~ N(0, k R), with R from the scale of the residual in each bin and the
    correlation of noise between bins. Both terms are the same in all frames, so R counts N times
    against C. For calibration every other template is left out, an average of 16 frames is drawn
    from each, and k maximises their density under the neighbouring templates. Those left out lie
    at the edge of a cell, other aspects within it, so k is rather too large.

    With the defaults, neither gain nor floor is known, as for a profile vector, and both priors are
    wide compared to the information in the profile. If frames contain a fixed number of target-free
    IFOVs besides those of the ship, a known floor reveals the number of IFOVs on the ship, which
    depends on its place: templates of one place are then wrong for a ship at another.

    The matched filter limits the band of the field, not of its magnitude: the smallest eigenvalue
    of C, relative to the variance of a bin, is 2e-3 at 30 ns, 3e-4 at 50 ns and 5e-7 at 200 ns
    (bins of 1 m). The diagonal loading l represents electronics and rounding after the detector,
    30 dB below the noise of a bin. At 30 ns scores agree within half a point for loadings from
    1e-7 to 1e-1; for longer pulses it prevents decisions on digits that are never recorded.

    A sum of magnitudes has skewness 0.63 over the square root of their number, IFOVs times N. From
    some 100 on, the probabilities are correct for sampled frames; with 32 they are one percentage
    point too high, with 2 three points (three similar labels, 40 % correct).

    Examples
    --------
    Two templates of five bins that differ in one bin by 0.2, with independent noise of 0.2 in each
    bin of a frame. Averaging frames turns a guess into certainty:

    >>> import numpy as np
    >>> from ncti.classify import GaussianTemplates
    >>> means = np.array([[0.0, 0.2, 1.0, 0.2, 0.0], [0.0, 0.2, 1.0, 0.4, 0.0]])
    >>> band = np.full((2, 1, 5), 0.04)
    >>> classifier = GaussianTemplates(gain_sigma=0.0, floor_sigma=0.0)
    >>> classifier = classifier.fit(means, band, ["duncan", "roberts"], floor=0.0)
    >>> for frame_count in (1, 4, 16):
    ...     print(frame_count, classifier.posterior(means[:1], frame_count).round(2))
    1 [[0.62 0.38]]
    4 [[0.88 0.12]]
    16 [[1. 0.]]
    """

    _parameter_constraints: ClassVar[dict] = {
        "gain_sigma": [Interval(Real, 0, MAX_PRIOR, closed="both")],
        "floor_sigma": [Interval(Real, 0, MAX_PRIOR, closed="both")],
        "diagonal_loading": [Interval(Real, 0, MAX_PRIOR, closed="both")],
        "template_error": [Interval(Real, 0, MAX_PRIOR, closed="both"), None],
    }

    def __init__(
        self,
        *,
        gain_sigma: float = 1.0,
        floor_sigma: float = 1.0,
        diagonal_loading: float = 1e-3,
        template_error: float | None = 0.0,
    ) -> None:
        self.gain_sigma = gain_sigma
        self.floor_sigma = floor_sigma
        self.diagonal_loading = diagonal_loading
        self.template_error = template_error

    @fit_context(prefer_skip_nested_validation=True)
    def fit(
        self,
        mean: ArrayLike,
        covariance: ArrayLike,
        labels: ArrayLike,
        floor: ArrayLike,
        *,
        aspect: ArrayLike | None = None,
        rng: np.random.Generator | None = None,
    ) -> Self:
        """Store the templates.

        Parameters
        ----------
        mean : (template, bin) or (template, place, bin) array_like
            Mean frame of each template, noise floor included, at one place of the ship on the
            IFOVs or at several.
        covariance : (template, lag, bin) array_like
            Covariance of *one* frame of each template as a lower band: element [t, l, n] is the
            covariance of bins n and n + l.
        labels : (template,) array_like
            Label of each template, such as a ship; templates may share labels.
        floor : array_like
            Noise floor included in `mean`, which does not scale with the gain of the target: one
            number, (bin,) or as the mean, with one bin or all. For profiles without a ship at the
            edges of the window use ``mean[..., :1]``; use 0 only if the floor has been removed.
        aspect : (template,) array_like, optional
            Aspect of each template [deg], distinct among templates of a label. Required with a
            template error.
        rng : numpy.random.Generator, optional
            Draws the averages for calibration. Required if `template_error` is None.

        Returns
        -------
        GaussianTemplates
            The fitted classifier itself.

        Raises
        ------
        ValueError
            If shapes do not match, an element is not finite, a covariance is not positive
            definite even with its loading, aspects are missing or not distinct, or the generator
            is missing.
        """
        means, bands, names, signal = checked_moments(mean, covariance, labels, floor)
        self.classes_, self.labels_ = np.unique(names, return_inverse=True)
        self.mean_ = means
        variance = float(bands[:, 0].mean())
        self._whole = bands.copy()
        self._whole[:, 0] += self.diagonal_loading * variance
        self.cholesky_ = cholesky_factors(self._whole, self.diagonal_loading)
        # Steps between places, and directions of a unit of gain and of the prior of the floor. The
        # likelihood needs them whitened, which for exact templates is done once.
        shift = np.full((len(means), 1, means.shape[2]), math.sqrt(variance))
        steps = means[:, 1:] - means[:, :1]
        self._directions = np.concatenate([steps, signal, shift], axis=1).transpose(0, 2, 1)
        self._nuisance = np.stack(
            [whiten(*pair) for pair in zip(self.cholesky_, self._directions, strict=True)]
        )
        self._correlation = mean_correlation(self._whole)
        self.template_error_ = 0.0
        if self.template_error != 0:
            if aspect is None:
                raise ValueError("aspect is None, but a template error needs the aspects")
            self.aspect_ = require_all("aspect", aspect)
            require_shape("aspect", self.aspect_, names.shape)
            self._find_cells()
            if self.template_error is None:
                if rng is None:
                    raise ValueError("rng is None, but calibration needs a random generator")
                self.template_error_ = UNCALIBRATED_ERROR  # so that calibration uses the cells
                self.template_error_ = calibrated_error(self, rng)
            else:
                self.template_error_ = float(self.template_error)
        return self

    def without(self, left_out: ArrayLike) -> Self:
        """Return a fitted copy without some of the templates.

        Parameters
        ----------
        left_out : (template,) array_like of bool
            Templates to leave out. With a template error the cells of their neighbours widen.

        Returns
        -------
        GaussianTemplates
            A copy with the same template error and the same mean variance.

        Raises
        ------
        ValueError
            If shapes do not match, or no template would be left.
        """
        check_is_fitted(self)
        out = require_flags("left_out", left_out)
        require_shape("left_out", out, self.labels_.shape)
        if out.all():
            raise ValueError("left_out is true for all templates, but must leave one")
        rest = copy(self)
        labels = self.classes_[self.labels_[~out]]
        rest.classes_, rest.labels_ = np.unique(labels, return_inverse=True)
        names = ["mean_", "cholesky_", "_whole", "_nuisance", "_directions"]
        if self.template_error_:
            names.append("aspect_")
        for name in names:
            setattr(rest, name, getattr(self, name)[~out])
        if rest.template_error_:
            rest._find_cells()
        return rest

    def _find_cells(self) -> None:
        """Add the tangent of each cell to the unknown directions, and store its residual."""
        means = self.mean_.mean(axis=1)
        tangent, self._residual = cells(means, self.labels_, self.aspect_, self._correlation)
        known = self._directions[..., : 2 * self.mean_.shape[1]]
        self._directions = np.concatenate([known, tangent[..., None]], axis=2)

    def log_likelihood(
        self, X: ArrayLike, frame_count: ArrayLike, *, gain_sigma: ArrayLike | None = None
    ) -> Floats:
        """Return the log density of each average under each template.

        Parameters
        ----------
        X : (sample, bin) array_like
            Averages of frames, noise floor included.
        frame_count : int or (sample,) array_like
            Number of frames in each average.
        gain_sigma : (...) array_like, optional
            Prior standard deviations of the gain, in place of that of the classifier. Several
            share the whitening of X, which is most of the work.

        Returns
        -------
        (..., sample, template) float64 ndarray
            Natural logarithm of the density.

        Raises
        ------
        ValueError
            If X is empty, has another number of bins, has an element that is not finite or whose
            square overflows, a count is below 1, or a deviation is out of range.
        """
        check_is_fitted(self)
        samples, frames = checked_averages(X, frame_count, self.mean_.shape[2])
        deviations = self.gain_sigma if gain_sigma is None else gain_sigma
        gains = require_all("gain_sigma", deviations, minimum=0, maximum=MAX_PRIOR)
        floors = require_all("floor_sigma", self.floor_sigma, minimum=0, maximum=MAX_PRIOR)
        pairs = np.stack([gains.ravel(), np.full(gains.size, floors)], axis=1)
        result = np.empty((len(pairs), len(samples), len(self.mean_)))
        with np.errstate(over="ignore", invalid="ignore"):
            for t in range(len(self.mean_)):
                # The residual is the same in all frames, so its weight against their noise grows
                # with their number: with a template error each number has a factor of its own.
                for count in np.unique(frames) if self.template_error_ else (None,):
                    rows = slice(None) if count is None else frames == count
                    result[..., rows, t] = self.density(t, samples[rows], frames[rows], pairs)
        if not np.isfinite(result).all():
            raise ValueError(
                f"X reaches {np.abs(samples).max():g}, but its squared distance to the templates "
                "must be a finite number"
            )
        return result.reshape(*gains.shape, len(samples), -1)

    def peak(self, frame_count: int, *, gain_sigma: float | None = None) -> Floats:
        """Return the highest log density under each template, reached at one of its means.

        Parameters
        ----------
        frame_count : int
            Number of frames in an average.
        gain_sigma : float, optional
            See `log_likelihood`.

        Returns
        -------
        (template,) float64 ndarray
            Natural logarithm of the density. Twice its difference from that of an average is the
            squared Mahalanobis distance, which `ncti.classify.misfit.log_fit` judges.

        Raises
        ------
        ValueError
            If the count is below 1 or the deviation is out of range.
        """
        check_is_fitted(self)
        require("frame_count", frame_count, minimum=1, maximum=MAX_PRIOR)
        gain = self.gain_sigma if gain_sigma is None else gain_sigma
        require("gain_sigma", gain, minimum=0, maximum=MAX_PRIOR)
        frames, priors = np.array([float(frame_count)]), np.array([[gain, self.floor_sigma]])
        peaks = (
            self.density(t, self.mean_[t], np.repeat(frames, self.mean_.shape[1]), priors).max()
            for t in range(len(self.mean_))
        )
        return np.fromiter(peaks, np.float64, len(self.mean_))

    def posterior(
        self, X: ArrayLike, frame_count: ArrayLike, *, log_prior: ArrayLike = 0.0
    ) -> Floats:
        """Return the probability of each label.

        Parameters
        ----------
        X, frame_count
            See `log_likelihood`.
        log_prior : (sample, template) or (template,) array_like, default=0
            See `label_posterior`.

        Returns
        -------
        (sample, class) float64 ndarray
            Probabilities; rows sum to 1. Labels have equal prior probabilities, and so have,
            without `log_prior`, the templates of a label.

        Raises
        ------
        ValueError
            See `log_likelihood`.
        """
        scores = self.log_likelihood(X, frame_count)
        return label_posterior(scores, self.labels_, log_prior=log_prior)[1]

    def predict(
        self, X: ArrayLike, frame_count: ArrayLike, *, log_prior: ArrayLike = 0.0
    ) -> NDArray:
        """Return the most probable label of each average.

        Parameters
        ----------
        X, frame_count, log_prior
            See `posterior`.

        Returns
        -------
        (sample,) ndarray
            Labels; of equally probable ones the first in `classes_`.
        """
        best = self.posterior(X, frame_count, log_prior=log_prior).argmax(axis=1)
        return self.classes_[best]

    def draw_averages(
        self, chosen: NDArray[np.bool_], frames: int, rng: np.random.Generator
    ) -> Floats:
        """Return (sample, bin) averages, one from each chosen template, at a random place."""
        factors, means = self.cholesky_[chosen], self.mean_[chosen]
        noise = rng.standard_normal((len(factors), means.shape[2]))
        deviations = np.array([colour(*pair) for pair in zip(factors, noise, strict=True)])
        place = rng.integers(means.shape[1], size=len(means))
        return means[np.arange(len(means)), place] + deviations / math.sqrt(frames)

    def density(self, template: int, samples: Floats, frames: Floats, priors: Floats) -> Floats:
        """Return `ncti.classify.bands.densities` for one template.

        With a template error the number of frames must be the same in all averages.
        """
        means, factor = self.mean_[template], self.cholesky_[template]
        unit = self._nuisance[template]
        if self.template_error_:
            scale = math.sqrt(frames[0] * self.template_error_) * self._residual[template]
            covariance = self._whole[template] + residual_band(scale, self._correlation)
            factor = cholesky_banded(covariance, lower=True)
            unit = whiten(factor, self._directions[template])
        return densities(factor, unit, samples, means[0], frames, priors, places=len(means))


def calibrated_error(templates: GaussianTemplates, rng: np.random.Generator) -> float:
    """Return the maximum-likelihood template error for held-out templates, 1e-4 to 100, to 5 %.

    It maximises the mean log density of averages of 16 frames from every second template of a
    label, under its two neighbours of the same label. It is 1 if no label has five templates.
    """
    from scipy.optimize import minimize_scalar

    out, neighbours = alternate_templates(templates.labels_, templates.aspect_)
    if not out.any():
        return UNCALIBRATED_ERROR
    samples, rest = templates.draw_averages(out, CALIBRATION_FRAMES, rng), templates.without(out)
    priors = np.array([[templates.gain_sigma, templates.floor_sigma]])
    answering = [(t, rows) for t, rows in enumerate(neighbours.T) if rows.any()]

    def negative_log_likelihood(log_error: float) -> float:
        """Return the mean negative log density of the averages."""
        rest.template_error_ = math.exp(log_error)
        logs = np.full(neighbours.shape, -np.inf)
        for t, rows in answering:
            frames = np.full(rows.sum(), float(CALIBRATION_FRAMES))
            logs[rows, t] = rest.density(t, samples[rows], frames, priors)[0]
        return -float(np.logaddexp.reduce(logs, axis=1).mean())

    bounds = tuple(map(math.log, ERROR_BOUNDS))
    optimum = minimize_scalar(
        negative_log_likelihood, bounds=bounds, method="bounded", options={"xatol": 0.05}
    )
    return math.exp(float(optimum.x))
