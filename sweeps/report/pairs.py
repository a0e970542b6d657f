"""Answers of two stores to the same views, and which of their differences exceed chance."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ncti.evaluate import AspectAccuracy, paired_difference, replicated_accuracy
from ncti.evaluate.answers import DRAWS, OF_ASPECTS, VIEW, by_bin
from sweeps.engine.declare.paths import PathOrUrl
from sweeps.report.frames import Part
from sweeps.report.stores import attributes, groups, opened, read
from sweeps.stages.classifier import drawn_aspects, kinds_of_aspects

ANSWERS = {
    "accuracy": "correct",
    "ship_accuracy": "ship_correct",
    "training_accuracy": "training_correct",
}
"""Variables of answers by those of their scores."""
MARKED = ("range_profile", "infrared")  # groups that say which aspects are learned
LEVEL = 0.05  # probability of any difference by chance that is said to be more


@dataclass(frozen=True)
class Pairs:
    """Answers of two stores in common, (..., draw, ship, aspect): 1 right, 0 wrong, else none."""

    first: xr.DataArray
    second: xr.DataArray

    @property
    def _draws(self) -> list[str]:
        return [dim for dim in DRAWS if dim in self.first.dims]

    @cached_property
    def _asked(self) -> NDArray[np.bool_]:
        return (self.first.values >= 0) & (self.second.values >= 0)

    @cached_property
    def unequal(self) -> NDArray[np.intp]:
        """Number of pairs of which one answer is right, (...)."""
        differ = (self.first.values != self.second.values) & self._asked
        return differ.sum(axis=tuple(range(-2 - len(self._draws), 0)))

    def differences(self, confidence: float = 0.95) -> AspectAccuracy:
        """Return the second fraction of right answers less the first, with intervals."""
        right = self.first.values == 1, self.second.values == 1
        about: dict[str, Any] = {"answered": self._asked, "confidence": confidence}
        return paired_difference(*right, self.first.aspect.values, draws=len(self._draws), **about)

    def exceed(self, confidence: float) -> NDArray[np.bool_]:
        """Return whether the interval over all aspects leaves out 0, (...)."""
        found = self.differences(confidence)
        return (found.ci_low[..., -1] > 0) | (found.ci_high[..., -1] < 0)

    def tabulate(self, sure: NDArray[np.bool_] | None) -> xr.Dataset:
        """Return differences by aspect bin, and which over all aspects exceed chance, if known."""
        found = self.differences()
        second = replicated_accuracy(
            self.second.values == 1,
            self.first.aspect.values,
            draws=len(self._draws),
            answered=self._asked,
        ).fraction
        whole = np.full(found.fraction.shape, np.nan)
        whole[..., -1] = np.nan if sure is None else sure
        unequal = np.broadcast_to(self.unequal[..., None], found.fraction.shape)
        figures = {
            "difference": (found.fraction, "fraction of ships identified, second less first"),
            "ci_low": (found.ci_low, "lower end of its 95 % interval"),
            "ci_high": (found.ci_high, "upper end of its 95 % interval"),
            "first": (second - found.fraction, "fraction of ships identified in the first store"),
            "second": (second, "fraction of ships identified in the second store"),
            "n": (found.n, "number of pairs of answers"),
            "unequal": (unequal, "number of pairs, at all aspects, of which one answer is right"),
            "sure": (whole, "1 where the difference is more than chance (Holm, 5 %), else 0"),
        }
        return by_bin(self.first, found.labels, figures)


def holm(family: Sequence[Pairs]) -> tuple[list[NDArray[np.bool_]], int]:
    """Return which differences over all aspects exceed chance, and the number of comparisons.

    Holm's step-down procedure: the intervals are those of `LEVEL` over the number of comparisons
    that do not exceed chance so far. Cells in which all answers are equal are not counted, since
    the number of unequal pairs says nothing about the direction of a difference.
    """
    counted = [pairs.unequal > 0 for pairs in family]
    number = sum(int(cells.sum()) for cells in counted)
    sure, before = [np.zeros_like(cells) for cells in counted], -1
    # Each difference that exceeds chance leaves a smaller number to correct the others for.
    while before < (found := sum(int(cells.sum()) for cells in sure)) < number:
        confidence, before = 1 - LEVEL / (number - found), found
        sure = [c & pairs.exceed(confidence) for c, pairs in zip(counted, family, strict=True)]
    return sure, number


def answers_of(path: PathOrUrl, part: Part) -> xr.DataArray:
    """Return the answers that a part of the scores counts, by kind of aspect.

    1 right, 0 wrong, negative for none, along a dimension `aspects` of the kinds that there are.
    """
    store = opened(path)
    group = part.group.replace("tables/", "classification/", 1)
    answers = read(store, group)[ANSWERS[part.display.figures[0].variable]].load()
    given, marked = attributes(store), [group for group in MARKED if group in groups(store)]
    if not marked:
        return answers
    learned = read(store, marked[0])["learned"].load().reset_coords(drop=True)
    ends = float(answers.aspect.min()), float(answers.aspect.max())
    number = given["configuration"]["grid"].get("random_aspects", 0)
    drawn = answers.aspect.isin(drawn_aspects(*ends, number, given["seed"]))
    kinds = kinds_of_aspects(learned, drawn)
    along = xr.DataArray(list(kinds), dims="aspects", name="aspects", attrs=OF_ASPECTS)
    return xr.concat([answers.where(where, -1) for where in kinds.values()], along)


def paired(first: xr.DataArray, second: xr.DataArray) -> Pairs | None:
    """Return the answers that both stores have; None without any.

    An axis of one value in each, such as the pulse width of 30 ns in one and 40 ns in the other, is
    left out.
    """
    first, second = _with_dims(first, second.dims), _with_dims(second, first.dims)
    single = [
        dim for dim in first.dims if dim not in VIEW and first.sizes[dim] == second.sizes[dim] == 1
    ]
    first, second = (answers.squeeze(single) for answers in (first, second))
    common = xr.align(first, second, join="inner")
    former, other = xr.broadcast(*(answers.reset_coords(drop=True) for answers in common))
    if 0 in former.shape or not {*VIEW} <= {*former.dims}:
        return None
    draws = [dim for dim in DRAWS if dim in former.dims]
    return Pairs(*(answers.transpose(..., *draws, *VIEW) for answers in (former, other)))


def _with_dims(answers: xr.DataArray, dims: Iterable[Hashable]) -> xr.DataArray:
    """Return answers with dimensions that another store has, where they have one value there."""
    return answers.expand_dims(
        [dim for dim in dims if dim in answers.coords and dim not in answers.dims]
    )
