"""Answers of two stores to the same views, and which of their differences are significant."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ncti.evaluate import AspectAccuracy, paired_difference, replicated_accuracy
from ncti.evaluate.answers import ASPECT_ATTRS, DRAWS, VIEW, label_bins
from sweeps.engine.declare.paths import PathOrUrl
from sweeps.report.frames import Part
from sweeps.report.stores import attributes, list_groups, open_store, read_group

ANSWERS = {
    "accuracy": "correct",
    "ship_accuracy": "ship_correct",
    "training_accuracy": "training_correct",
}
"""Variables of answers by those of their scores."""
LEVEL = 0.05  # family-wise error rate


@dataclass(frozen=True)
class Pairs:
    """Answers that two stores share, (..., draw, ship, aspect): 1 right, 0 wrong, negative none."""

    first: xr.DataArray
    second: xr.DataArray

    @property
    def _draws(self) -> list[str]:
        return [dim for dim in DRAWS if dim in self.first.dims]

    @cached_property
    def _answered(self) -> NDArray[np.bool_]:
        return (self.first.values >= 0) & (self.second.values >= 0)

    @cached_property
    def discordant(self) -> NDArray[np.intp]:
        """Number of discordant pairs, in which one answer is right, (...)."""
        differ = (self.first.values != self.second.values) & self._answered
        return differ.sum(axis=tuple(range(-2 - len(self._draws), 0)))

    def differences(self, confidence: float = 0.95) -> AspectAccuracy:
        """Return the second fraction of right answers less the first, with intervals."""
        return paired_difference(
            self.first.values == 1,
            self.second.values == 1,
            self.first.aspect.values,
            answered=self._answered,
            draws=len(self._draws),
            confidence=confidence,
        )

    def excludes_zero(self, confidence: float) -> NDArray[np.bool_]:
        """Return whether the intervals over all aspects exclude 0, (...)."""
        interval = self.differences(confidence)
        return (interval.ci_low[..., -1] > 0) | (interval.ci_high[..., -1] < 0)

    def tabulate(self, significant: NDArray[np.bool_] | None) -> xr.Dataset:
        """Return differences by aspect bin, and their significance over all aspects if known."""
        difference = self.differences()
        second = replicated_accuracy(
            self.second.values == 1,
            self.first.aspect.values,
            draws=len(self._draws),
            answered=self._answered,
        ).fraction
        overall = np.full(difference.fraction.shape, np.nan)
        overall[..., -1] = np.nan if significant is None else significant
        discordant = np.broadcast_to(self.discordant[..., None], difference.fraction.shape)
        figures = {
            "difference": (difference.fraction, "fraction of ships identified, second less first"),
            "ci_low": (difference.ci_low, "lower end of its 95 % interval"),
            "ci_high": (difference.ci_high, "upper end of its 95 % interval"),
            "first": (
                second - difference.fraction,
                "fraction of ships identified in the first store",
            ),
            "second": (second, "fraction of ships identified in the second store"),
            "n": (difference.n, "number of pairs of answers"),
            "discordant": (discordant, "number of pairs, at all aspects, with one right answer"),
            "significant": (overall, "1 where the difference is significant (Holm, 5 %), else 0"),
        }
        return label_bins(self.first, difference.labels, figures)


def holm(family: Sequence[Pairs]) -> tuple[list[NDArray[np.bool_]], int]:
    """Return masks of significant differences over all aspects, and the number of comparisons.

    Holm's step-down procedure: the intervals are those of `LEVEL` over the number of comparisons
    that are not significant so far. Cells in which all answers are equal are not counted, since
    the number of discordant pairs says nothing about the direction of a difference.
    """
    compared = [pairs.discordant > 0 for pairs in family]
    significant = [np.zeros_like(cells) for cells in compared]
    number = remaining = sum(int(cells.sum()) for cells in compared)
    before = -1
    # Holm: each significant difference leaves a smaller family to correct the others for.
    while before != remaining > 0:
        confidence, before = 1 - LEVEL / remaining, remaining
        significant = [
            cells & pairs.excludes_zero(confidence)
            for pairs, cells in zip(family, compared, strict=True)
        ]
        remaining = number - sum(int(cells.sum()) for cells in significant)
    return significant, number


def answers_of(path: PathOrUrl, part: Part) -> xr.DataArray:
    """Return the answers behind a part of the scores, by kind of aspect.

    1 right, 0 wrong, negative for none, along a dimension `aspects` of the kinds present.
    """
    from sweeps.stages.classifier import draw_aspects, kinds_of_aspects

    store = open_store(path)
    group = part.group.replace("tables/", "classification/", 1)
    answers = read_group(store, group)[ANSWERS[part.display.figures[0].variable]].load()
    attrs = attributes(store)
    sensor_groups = [group for group in list_groups(store) if "learned" in store[group]]
    if not sensor_groups:
        return answers
    learned = read_group(store, sensor_groups[0])["learned"].load().reset_coords(drop=True)
    ends = float(answers.aspect.min()), float(answers.aspect.max())
    number = attrs["configuration"]["grid"].get("random_aspects", 0)
    drawn = answers.aspect.isin(draw_aspects(*ends, number, attrs["seed"]))
    kinds = kinds_of_aspects(learned, drawn)
    along = xr.DataArray(list(kinds), dims="aspects", name="aspects", attrs=ASPECT_ATTRS)
    return xr.concat([answers.where(mask, -1) for mask in kinds.values()], along)


def pair_answers(first: xr.DataArray, second: xr.DataArray) -> Pairs | None:
    """Return the answers that both stores have; None without any.

    An axis of one value in each, such as the pulse width of 30 ns in one and 40 ns in the other, is
    left out.
    """
    first, second = _expand_dims(first, second.dims), _expand_dims(second, first.dims)
    single = [
        dim for dim in first.dims if dim not in VIEW and first.sizes[dim] == second.sizes[dim] == 1
    ]
    first, second = (answers.squeeze(single) for answers in (first, second))
    common = xr.align(first, second, join="inner")
    former, latter = xr.broadcast(*(answers.reset_coords(drop=True) for answers in common))
    if 0 in former.shape or not {*VIEW} <= {*former.dims}:
        return None
    draws = [dim for dim in DRAWS if dim in former.dims]
    order = ..., *draws, *VIEW
    return Pairs(former.transpose(*order), latter.transpose(*order))


def _expand_dims(answers: xr.DataArray, dims: Iterable[Hashable]) -> xr.DataArray:
    """Return answers expanded by another store's dimensions that are scalar coordinates here."""
    return answers.expand_dims(
        [dim for dim in dims if dim in answers.coords and dim not in answers.dims]
    )
