"""Fractions of correct answers by aspect bin, with Wilson intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_flags
from ncti.labels import labelled_array

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes

BIN = "aspect_bin"
OVERALL = "overall"
EDGES = (0.0, 30.0, 60.0, 90.0)  # deg; bins of the article
BIN_WIDTH = 30.0  # deg; bins beyond the last edge

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class AspectAccuracy:
    """Fractions of correct answers by aspect bin and overall, with confidence intervals.

    Attributes
    ----------
    labels : tuple of str
        Names of the bins, from the aspects in them ("0-27"); the last is "overall".
    fraction : (..., bin) float64 ndarray
        Correct answers over answers, in [0, 1]; NaN if there are none. If `is_difference`, the
        difference of two classifiers' fractions, in [-1, 1].
    ci_low, ci_high : (..., bin) float64 ndarray
        Ends of the confidence interval of the fraction.
    n : (..., bin) intp ndarray
        Number of answers.
    confidence : float
        Probability that the interval covers the true value.
    is_difference : bool
        Whether the fractions are differences; see `paired_difference`.

    See Also
    --------
    accuracy_by_aspect : Accuracy with one answer per view.
    replicated_accuracy : Accuracy with several answers per view.

    Examples
    --------
    >>> from ncti.evaluate import accuracy_by_aspect
    >>> accuracy = accuracy_by_aspect([[True, True, False]], [0, 40, 80])
    >>> dict(zip(accuracy.labels, accuracy.fraction.round(2).tolist()))
    {'0': 1.0, '40': 1.0, '80': 0.0, 'overall': 0.67}
    """

    labels: tuple[str, ...]
    fraction: Floats
    ci_low: Floats
    ci_high: Floats
    n: Integers
    confidence: float = 0.95
    is_difference: bool = False

    def to_xarray(self) -> xr.Dataset:
        """Return the arrays with their labels; leading axes are `dim_0`, `dim_1` and so on."""
        import xarray as xr

        dims = (*(f"dim_{axis}" for axis in range(self.fraction.ndim - 1)), BIN)
        kind, interval = "difference" * self.is_difference, f"{100 * self.confidence:g} % interval"
        columns = {
            "fraction": (self.fraction, f"{kind or 'fraction'} of correct answers"),
            "ci_low": (self.ci_low, f"lower end of the {interval}"),
            "ci_high": (self.ci_high, f"upper end of the {interval}"),
            "n": (self.n, "answers"),
        }
        return xr.Dataset(
            {
                name: labelled_array(dims, values, "1", label)
                for name, (values, label) in columns.items()
            },
            {BIN: labelled_array(BIN, np.array(self.labels), "1", "aspects of the bin [deg]")},
        )

    def to_pandas(self) -> pd.DataFrame:
        """Return one row a bin, or a bin of each leading axis."""
        return self.to_xarray().to_dataframe()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw percent correct by aspect bin, with intervals; ValueError with more axes."""
        if self.fraction.ndim > 1:
            shape = self.fraction.shape
            raise ValueError(f"fraction has shape {shape}, but must have bins alone to be drawn")
        ax = axes_to_draw_in(ax)
        percent, low, high = (100 * values for values in (self.fraction, self.ci_low, self.ci_high))
        ax.errorbar(self.labels, percent, (percent - low, high - percent), fmt="o", capsize=3)
        if self.is_difference:
            ax.set(xlabel="aspect [deg]", ylabel="difference of correct answers [points]")
            ax.axhline(0, linewidth=1)
        else:
            ax.set(xlabel="aspect [deg]", ylabel="correct answers [%]", ylim=(0, 105))
        return ax

    def _repr_html_(self) -> str:
        """Return percent correct with its interval, one row per bin, as HTML."""
        frame = self.to_pandas()
        percent = [
            f"{100 * row.fraction:.0f} [{100 * row.ci_low:.0f}-{100 * row.ci_high:.0f}]"
            if row.n
            else ""
            for row in frame.itertuples()
        ]
        name = "difference [points]" if self.is_difference else "percent correct"
        return str(frame.assign(**{name: percent})[[name, "n"]].to_html())


def axes_to_draw_in(ax: Axes | None) -> Axes:
    """Return axes to draw in, new ones if none are given."""
    if ax is None:
        from matplotlib import pyplot as plt

        ax = plt.subplots(layout="constrained")[1]
    return ax


def wilson_interval(
    successes: ArrayLike, trials: ArrayLike, *, confidence: float = 0.95
) -> tuple[Floats, Floats]:
    """Return the Wilson confidence interval of a probability from a number of successes.

    Parameters
    ----------
    successes, trials : (...) array_like
        Counts, 0 <= successes <= trials. They need not be whole numbers.
    confidence : float, default=0.95
        Probability that the interval covers the true value, in (0, 1).

    Returns
    -------
    low, high : (...) float64 ndarray
        Ends of the interval, in [0, 1]; 0 and 1 without trials.

    Raises
    ------
    ValueError
        If a count is negative or NaN, successes exceed trials, or the confidence is not in (0, 1).

    See Also
    --------
    accuracy_by_aspect : Accuracies with such intervals.
    replicated_accuracy : Intervals for answers that are not independent.

    Notes
    -----
    The values p at which the score test does not reject k successes in n trials [1]_:
    |k/n - p| <= z sqrt(p (1 - p)/n), hence the roots of (n + z^2) p^2 - (2k + z^2) p + k^2/n.
    Unlike the normal interval it stays within [0, 1] and has a finite width at k = 0 and k = n.
    Trials are assumed independent; neighbouring aspects of one ship are not quite.

    References
    ----------
    .. [1] E. B. Wilson, "Probable inference, the law of succession, and statistical inference",
       Journal of the American Statistical Association 22, 209-212 (1927),
       doi:10.1080/01621459.1927.10502953.

    Examples
    --------
    Eight in ten leave a wide interval, 80 in 100 a third of it. Ten in ten are no proof of
    certainty:

    >>> from ncti.evaluate import wilson_interval
    >>> low, high = wilson_interval([8, 80, 10], [10, 100, 10])
    >>> low.round(2), high.round(2)
    (array([0.49, 0.71, 0.72]), array([0.94, 0.87, 1.  ]))
    """
    k, n = require_all("successes", successes), require_all("trials", trials)
    try:
        k, n = np.broadcast_arrays(k, n)
    except ValueError:
        raise ValueError(
            f"successes has shape {k.shape}, but must have that of trials, {n.shape}"
        ) from None
    if not np.all((k >= 0.0) & (k <= n)):
        raise ValueError(
            f"successes is {successes!r} of {trials!r} trials, but must be counts with "
            "0 <= successes <= trials"
        )
    require("confidence", confidence, positive=True, below=1.0)
    from scipy.special import ndtri

    z = ndtri(0.5 + 0.5 * confidence)
    failures = n - k
    spread = z * np.sqrt(z**2 / 4.0 + k * failures / np.where(n > 0.0, n, 1.0))
    low = (k + z**2 / 2.0 - spread) / (n + z**2)
    high = (k + z**2 / 2.0 + spread) / (n + z**2)
    # Without failures the upper root is exactly 1 except for rounding; the lower one is exact.
    return low, np.where(failures == 0.0, 1.0, high)


def aspect_bins(aspects: ArrayLike) -> tuple[tuple[str, ...], Integers]:
    """Return the 30 degree bin of each aspect, and the names of the bins.

    Parameters
    ----------
    aspects : (aspect,) array_like
        Aspects [deg], from 0 to 360, in any order.

    Returns
    -------
    labels : tuple of str
        Names of the bins that hold an aspect, in increasing order: the lowest and highest aspect
        in the bin, "0-27", or the only one, "90".
    index : (aspect,) intp ndarray
        Bin of each aspect, as an index into `labels`.

    Raises
    ------
    ValueError
        If aspects are not a non-empty sequence of numbers from 0 to 360.

    See Also
    --------
    accuracy_by_aspect : Fractions of correct answers by bin.

    Notes
    -----
    Up to 90 degrees a bin holds its lower edge, [30, 60), and the last one both, [60, 90], as in
    [1]_: 0, 3, ... 90 deg fall into 0-27, 30-57 and 60-90. Beyond 90 degrees a bin holds its upper
    edge, (90, 120], so that aspects astern are binned as the mirror image of those ahead. The bin
    of an aspect never depends on the other aspects.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Table 2.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.evaluate import aspect_bins
    >>> labels, index = aspect_bins(np.arange(0, 91, 3))
    >>> labels
    ('0-27', '30-57', '60-90')
    >>> np.bincount(index)
    array([10, 10, 11])
    """
    values = np.round(require_all("aspects", aspects), 9)  # 0.1 * 300 is 30, not a bit above it
    if values.ndim != 1 or values.size == 0:
        raise ValueError(f"aspects has shape {values.shape}, but must be a non-empty sequence")
    if not np.all((values >= EDGES[0]) & (values <= 360.0)):
        raise ValueError(
            f"aspects has {values.min():g} to {values.max():g}, but must be from {EDGES[0]:g} to "
            "360 deg"
        )
    beyond = np.arange(EDGES[-1], 360.0, BIN_WIDTH)
    bins = np.searchsorted(EDGES[1:-1], values, side="right")
    bins += np.searchsorted(beyond, values, side="left")
    occupied, index = np.unique(bins, return_inverse=True)
    spans = [values[bins == k] for k in occupied]
    for digits in range(1, 10):  # until no two bins have the same name
        labels = tuple(_span(span, digits) for span in spans)
        if len({*labels}) == len(labels):
            break
    return labels, index.astype(np.intp)


def accuracy_by_aspect(
    correct: ArrayLike,
    aspects: ArrayLike,
    *,
    answered: ArrayLike = True,
) -> AspectAccuracy:
    """Return the fraction of correct answers in each aspect bin and overall.

    Parameters
    ----------
    correct : (..., ship, aspect) array_like of bool
        True for correct answers; leading axes may be pulse width and frame count, for example.
    aspects : (aspect,) array_like
        Aspects [deg].
    answered : array_like of bool, default=True
        False for answers to leave out, such as those to views that are missing; broadcast to
        `correct`.

    Returns
    -------
    AspectAccuracy
        Arrays with the axes (..., bin), the bin "overall" last, and 95 % Wilson intervals.

    Raises
    ------
    ValueError
        If `correct` is not boolean or its last axis does not match the aspects.

    See Also
    --------
    replicated_accuracy : Accuracy with several answers per view.
    aspect_bins : The bins.
    wilson_interval : The confidence interval.

    Notes
    -----
    All ships and aspects of a bin are pooled. "Overall" pools all answers, so that bins are
    weighted by their number of aspects: 10, 10 and 11 of 31 aspects from 0 to 90 degrees.

    Examples
    --------
    Four ships at 31 aspects, two of them never recognised from 60 degrees on:

    >>> import numpy as np
    >>> from ncti.evaluate import accuracy_by_aspect
    >>> correct = np.ones((4, 31), dtype=bool)
    >>> correct[:2, 20:] = False
    >>> accuracy = accuracy_by_aspect(correct, np.arange(0, 91, 3))
    >>> accuracy.labels
    ('0-27', '30-57', '60-90', 'overall')
    >>> accuracy.fraction.round(2)
    array([1.  , 1.  , 0.5 , 0.82])
    >>> accuracy.ci_low.round(2), accuracy.ci_high.round(2)
    (array([0.91, 0.91, 0.36, 0.75]), array([1.  , 1.  , 0.64, 0.88]))
    """
    labels, index = aspect_bins(aspects)
    right = checked_answers(correct, len(index))
    # Counts by bin are products with the membership of aspects in bins; the last bin holds all.
    flags = np.broadcast_to(require_flags("answered", answered, right.shape), right.shape)
    member = np.ones((len(index), len(labels) + 1), dtype=np.intp)
    member[:, :-1] = index[:, None] == np.arange(len(labels))
    hits = (right & flags).sum(axis=-2) @ member
    n = flags.sum(axis=-2) @ member
    low, high = wilson_interval(hits, n)
    fraction = np.divide(hits, n, out=np.full(hits.shape, np.nan), where=n > 0)
    return AspectAccuracy((*labels, OVERALL), fraction, low, high, n)


def checked_answers(correct: ArrayLike, aspects: int, draws: int = 0) -> NDArray[np.bool_]:
    """Return answers as an array, or raise `ValueError` unless they are boolean.

    Their axes are (..., ship, aspect), with `draws` axes of draws before the ships.
    """
    try:
        right = np.asarray(correct)
    except ValueError:
        raise ValueError("correct is ragged, but must be an array of booleans") from None
    if right.dtype != np.bool_:
        raise ValueError(f"correct has dtype {right.dtype}, but must be boolean")
    if right.ndim < draws + 2 or right.shape[-1] != aspects:
        axes = ", ".join(("...", *["draw"] * draws, "ship", "aspect"))
        raise ValueError(
            f"correct has shape {right.shape}, but must have the axes ({axes}) with {aspects} "
            f"aspects, where draws is {draws}"
        )
    return right


def _span(aspects: Floats, digits: int) -> str:
    """Return the name of a bin: "0-27" for aspects from 0 to 27, "90" for a single one."""
    low, high = (f"{round(float(end), digits):.12g}" for end in (aspects.min(), aspects.max()))
    return low if low == high else f"{low}-{high}"
