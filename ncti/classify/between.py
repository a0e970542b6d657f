"""Aspects between templates: how far a template may be off within the cell it stands for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require_all

CIRCLE = 360.0  # degrees
LEAST_CURVED = 3  # templates of a label whose curvature along aspects is known

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Cell:
    """What profiles do in the cell of aspects that each template stands for.

    Attributes
    ----------
    tangent : (template, bin) float64 ndarray
        Difference from the template at one standard deviation of the aspect within its cell.
    residual : (template, bin) float64 ndarray
        Scale of what a tangent leaves over.
    """

    tangent: Floats
    residual: Floats


def cells(mean: ArrayLike, labels: ArrayLike, aspect: ArrayLike, correlation: ArrayLike) -> Cell:
    """Tangent and residual of every template, from its neighbours of the same label.

    Parameters
    ----------
    mean : (template, bin) array_like
        Mean profile of each template.
    labels : (template,) array_like
        What a template stands for, such as a ship.
    aspect : (template,) array_like
        Where it was taken [degree]; distinct among templates of a label.
    correlation : (lag,) array_like
        Correlation of noise between bins so far apart, 1 at first: what a pulse smears.

    Returns
    -------
    Cell
        Both are 0 for a label of one template, of whose neighbourhood nothing is known.

    Raises
    ------
    ValueError
        If shapes do not match, or two templates of a label have one aspect.

    Notes
    -----
    A template at aspect a with neighbours h- before and h+ behind stands for aspects from
    a - h-/2 to a + h+/2. If x is uniform there, its second moment about a is

        s^2 = ((h-/2)^3 + (h+/2)^3) / (3 (h-/2 + h+/2)),

    h^2/12 for equal steps; the last template of an open range has one neighbour, and the same
    moment. Expanded to the second order, the profile at a + x is m + m' x + m'' x^2 / 2, with m'
    and m'' from the parabola through a template and its neighbours:

    - m' s is the *tangent*: x becomes one more unknown along a known direction. It is the same in
      all frames of an average.
    - m'' h^2 / 2, h the mean of both steps, is the scale of the *residual*; that at equal steps is
      half the second difference. Glints come and go within a step, and lines of a ship move
      through several bins, so that a parabola only says where and how much profiles change: the
      residual is taken as random, of a variance that is a multiple of its square.

    That multiple is `template_error` of `ncti.classify.GaussianTemplates`. m''^2 is smoothed along
    bins by the correlation of noise, since what changes may as well lie a pulse further, and
    averaged over labels at the nearest aspect: else the ship that changes most would have the
    widest covariance, and explain what the others cannot. At the ends of an open range m'' is
    that of the template beside it. With two templates, half their difference takes the place of
    the residual.
    """
    means = require_all("mean", mean)
    aspects = require_all("aspect", aspect)
    kernel = np.maximum(require_all("correlation", correlation), 0.0)
    names = np.asarray(labels)
    if means.ndim != 2 or aspects.shape != means.shape[:1] or names.shape != aspects.shape:
        raise ValueError(
            f"aspect has shape {aspects.shape}, but must have one for each of the labels and rows "
            f"of mean, of shapes {names.shape} and {means.shape}"
        )
    tangent, step = np.zeros_like(means), np.zeros(len(means))
    curvature: list[tuple[Floats, Floats]] = []  # of each label: its aspects, and squares there
    for name in np.unique(names):
        own = np.flatnonzero(names == name)
        own = own[np.argsort(aspects[own] % CIRCLE)]
        if len(own) < 2:
            continue
        slope, bend, before, behind = _parabolas(means[own], aspects[own] % CIRCLE, name)
        moment = (before**3 + behind**3) / (12 * (before + behind))
        tangent[own] = np.sqrt(moment)[:, None] * slope
        step[own] = (before + behind) / 2
        curvature.append((aspects[own], bend**2))
    if not curvature:
        return Cell(tangent, np.zeros_like(means))
    whole = np.concatenate([kernel[:0:-1], kernel]) / (2 * kernel.sum() - kernel[0])
    pooled = np.zeros_like(means)
    for at, square in curvature:
        apart = np.abs(aspects[:, None] - at) % CIRCLE
        nearest = np.minimum(apart, CIRCLE - apart).argmin(axis=1)
        smooth = np.stack([_smoothed(row, whole) for row in square])
        pooled += smooth[nearest] / len(curvature)
    return Cell(tangent, np.sqrt(pooled) * (step**2 / 2)[:, None])


def every_other(
    labels: ArrayLike, aspect: ArrayLike
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Every second template of each label, to be left out, and those that remain beside it.

    Parameters
    ----------
    labels, aspect : (template,) array_like
        As for `cells`.

    Returns
    -------
    left_out : (template,) bool ndarray
        None of a label with fewer than five: of two that remain, no curvature would be known.
    beside : (left out, kept) bool ndarray
        The two of its label that are nearest.
    """
    names, aspects = np.asarray(labels), np.asarray(aspect, dtype=np.float64) % CIRCLE
    left_out = np.zeros(len(names), dtype=bool)
    for name in np.unique(names):
        own = np.flatnonzero(names == name)
        if len(own) >= 2 * LEAST_CURVED - 1:
            left_out[own[np.argsort(aspects[own])][1::2]] = True
    apart = np.abs(aspects[left_out][:, None] - aspects[~left_out])
    apart = np.where(
        names[left_out][:, None] == names[~left_out], np.minimum(apart, CIRCLE - apart), np.inf
    )
    beside = np.zeros(apart.shape, dtype=bool)
    np.put_along_axis(beside, np.argsort(apart, axis=1, kind="stable")[:, :2], True, axis=1)
    return left_out, beside


def _parabolas(
    means: Floats, aspects: Floats, name: object
) -> tuple[Floats, Floats, Floats, Floats]:
    """First and second derivatives at ascending aspects, and steps before and behind [degree].

    A range closes if the step over 360 degrees is no wider than the widest within.
    """
    inner = np.diff(aspects)
    across = CIRCLE - aspects[-1] + aspects[0]
    if inner.min() <= 0 or across <= 0:
        raise ValueError(
            f"aspect has {aspects[:-1][inner <= 0][0]:g} twice for {name!r}, but templates of a "
            "label must have one each"
        )
    closed = across <= inner.max() * (1 + 1e-9)
    rise = np.diff(means, axis=0) / inner[:, None]
    if closed:
        last = (means[:1] - means[-1:]) / across
        before, behind = np.append(across, inner), np.append(inner, across)
        left, right = np.concatenate([last, rise]), np.concatenate([rise, last])
    else:
        before, behind = np.append(inner[0], inner), np.append(inner, inner[-1])
        left, right = np.concatenate([rise[:1], rise]), np.concatenate([rise, rise[-1:]])
    total = (before + behind)[:, None]
    slope = (left * behind[:, None] + right * before[:, None]) / total
    bend = 2 * (right - left) / total
    if not closed:
        if len(means) >= LEAST_CURVED:
            bend[0], bend[-1] = bend[1], bend[-2]
        else:  # bend h^2 / 2 is half the difference of the two
            bend = rise[[0, 0]] / inner[0]
    return slope, bend, before, behind


def _smoothed(row: Floats, kernel: Floats) -> Floats:
    """A row convolved with a symmetric kernel, which may be wider than it."""
    half = len(kernel) // 2
    return np.convolve(row, kernel)[half : half + len(row)]
