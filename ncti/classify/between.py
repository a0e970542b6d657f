"""Aspects between templates: change of the profile within the cell of a template."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

CIRCLE = 360.0  # deg
MIN_CURVED = 3  # templates of a label needed for a curvature along aspect

Floats = NDArray[np.float64]


def cells(
    means: Floats, labels: NDArray[Any], aspects: Floats, correlation: Floats
) -> tuple[Floats, Floats]:
    """Return tangent and residual (template, bin) of templates, from neighbours of the same label.

    Both describe how profiles change within the cell of aspects that a template represents: the
    tangent is the difference from the template at one standard deviation of the aspect within the
    cell, the residual the scale of the remaining difference.

    `means` (template, bin) are mean profiles, `labels` (template,), `aspects` (template,) [deg],
    distinct within a label; `correlation` (lag,) is that of noise between bins, as wide as the
    pulse. A template at aspect a with neighbours at a - h- and a + h+ represents the aspects from a
    - h-/2 to a + h+/2. For an offset x uniform over this cell the second moment is

        s^2 = ((h-/2)^3 + (h+/2)^3) / (3 (h-/2 + h+/2)),

    h^2/12 for equal steps. The last template of an open range has one neighbour, and the same
    moment. To second order, the profile at a + x is m + m' x + m'' x^2 / 2, with m' and m'' from
    the parabola through a template and its neighbours:

    - m' s is the *tangent*: x becomes one more unknown along a known direction, the same in all
      frames of an average.
    - m'' h^2 / 2, with h the mean of both steps, is the scale of the *residual*, for equal steps
      half the second difference. Glints appear and vanish within a step, and features of a ship
      move through several bins, so a parabola only indicates the place and amount of the change.
      The residual is therefore modelled as random, with a variance proportional to its square.

    The factor is `template_error` of `ncti.classify.GaussianTemplates`. m''^2 is smoothed over bins
    by the correlation of noise, because a change may equally well occur a pulse length away, and
    averaged over labels at the nearest aspect; otherwise the ship that changes most would have the
    widest covariance and match profiles of the others. The ends of an open range take m'' from the
    adjacent template. With two templates, half their difference replaces the residual; tangent and
    residual of a single template are 0.
    """
    # Tangents, steps and squared curvatures, label by label.
    tangent, step = np.zeros_like(means), np.zeros(len(means))
    curvature: list[tuple[Floats, Floats]] = []  # aspects of a label, and squares at them
    for name, rows in rows_by_label(labels, aspects):
        if len(rows) < 2:
            continue
        slope, bend, before, after = _parabolas(means[rows], aspects[rows] % CIRCLE, name)
        moment = (before**3 + after**3) / (12 * (before + after))
        tangent[rows] = np.sqrt(moment)[:, None] * slope
        step[rows] = (before + after) / 2
        curvature.append((aspects[rows], bend**2))
    if not curvature:
        return tangent, np.zeros_like(means)
    # Curvatures smoothed over bins and averaged over labels at the nearest aspect.
    kernel = np.maximum(correlation, 0.0)
    symmetric = np.concatenate([kernel[:0:-1], kernel]) / (2 * kernel.sum() - kernel[0])
    pooled = np.zeros_like(means)
    half = len(symmetric) // 2  # the kernel may be wider than a row
    for angles, square in curvature:
        nearest = separation(aspects[:, None], angles).argmin(axis=1)
        smooth = [np.convolve(row, symmetric)[half : half + len(row)] for row in square]
        pooled += np.stack(smooth)[nearest] / len(curvature)
    return tangent, np.sqrt(pooled) * (step**2 / 2)[:, None]


def alternate_templates(
    names: NDArray[Any], aspects: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return every second template of each label (template,), to leave out, and its neighbours.

    The neighbours are a mask (left out, kept) of the two nearest of the same label. Labels with
    fewer than five templates keep all, because the curvature of the remaining two would be unknown.
    """
    aspects = aspects % CIRCLE
    left_out = np.zeros(len(names), dtype=bool)
    for _, rows in rows_by_label(names, aspects):
        if len(rows) >= 2 * MIN_CURVED - 1:
            left_out[rows[1::2]] = True
    distance = separation(aspects[left_out][:, None], aspects[~left_out])
    distance[names[left_out][:, None] != names[~left_out]] = np.inf
    neighbours = np.zeros(distance.shape, dtype=bool)
    np.put_along_axis(neighbours, np.argsort(distance, axis=1, kind="stable")[:, :2], True, axis=1)
    return left_out, neighbours


def halves(names: NDArray[Any], aspects: Floats) -> list[NDArray[np.bool_]]:
    """Return two masks (template,) of templates to leave out in turn, or none.

    The first mask is that of `alternate_templates`; the second marks the other templates, except
    those at the ends of each label. The list is empty if no label has enough templates.
    """
    second, _ = alternate_templates(names, aspects)
    between = np.zeros(len(names), dtype=bool)
    for _, rows in rows_by_label(names, aspects):
        if second[rows].any():
            between[rows[2:-1:2]] = True
    return [second, between] if second.any() else []


def rows_by_label(names: NDArray, aspects: Floats) -> Iterator[tuple[Any, NDArray[np.intp]]]:
    """Yield each label, and the numbers of its templates by ascending aspect from 0 to 360 deg."""
    for name in np.unique(names):
        rows = np.flatnonzero(names == name)
        yield name, rows[np.argsort(aspects[rows] % CIRCLE)]


def separation(first: Floats, second: Floats) -> Floats:
    """Return the angles (...) between aspects (...) [deg], from 0 to 180."""
    distance = np.abs(first - second) % CIRCLE
    return np.minimum(distance, CIRCLE - distance)


def steps(aspects: Floats, name: object) -> tuple[Floats, Floats, bool]:
    """Return the steps on both sides of ascending aspects [deg], and whether they are closed.

    The range is closed if the step across 360 degrees is no wider than the widest step within; the
    ends of an open range have the same step on both sides. `ValueError` reports a duplicate aspect
    of the label `name`.
    """
    inner = np.diff(aspects)
    across = CIRCLE - aspects[-1] + aspects[0]
    if inner.min() <= 0 or across <= 0:
        raise ValueError(
            f"aspect has {aspects[:-1][inner <= 0][0]:g} twice for {name!r}, but must be distinct "
            "among templates of a label"
        )
    closed = bool(across <= inner.max() * (1 + 1e-9))
    first, last = (across, across) if closed else (inner[0], inner[-1])
    return np.append(first, inner), np.append(inner, last), closed


def _parabolas(
    means: Floats, aspects: Floats, name: object
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return first and second derivatives at ascending aspects, and steps on both sides [deg]."""
    before, after, closed = steps(aspects, name)
    rise = np.diff(means, axis=0) / after[:-1, None]
    if closed:
        last = (means[:1] - means[-1:]) / after[-1]
        left, right = np.concatenate([last, rise]), np.concatenate([rise, last])
    else:
        left, right = np.concatenate([rise[:1], rise]), np.concatenate([rise, rise[-1:]])
    total = (before + after)[:, None]
    slope = (left * after[:, None] + right * before[:, None]) / total
    bend = 2 * (right - left) / total
    if not closed:
        if len(means) >= MIN_CURVED:
            bend[0], bend[-1] = bend[1], bend[-2]
        else:  # so that bend h^2 / 2 is half the difference of the two templates
            bend = rise[[0, 0]] / after[0]
    return slope, bend, before, after
