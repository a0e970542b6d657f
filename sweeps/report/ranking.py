"""Classifiers compared along the swept axis, the best first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import pandas as pd

from sweeps.report.frames import Frame, values_of
from sweeps.report.pivot import select_main, word_axes
from sweeps.report.words import SIMPLEST, is_missing, preferred_value

SCORES, SHIP = "scores", "ship"
TRAINING_KINDS = ("training", "learned")  # kinds of scores that are not of tests
DEFAULT_AXIS = "frame_count"  # the axis of scores where nothing was swept


def is_test(kind: Any) -> bool:
    """Return whether scores of a kind are of tests."""
    return kind not in TRAINING_KINDS


@dataclass(frozen=True)
class Candidate:
    """One classifier's results at the preferred setting, in the order of an axis.

    `axis` is empty if the results do not depend on it. `shared` holds the values of the axis that
    all candidates have; `count` is the number of values that any candidate has.
    """

    of: Mapping[str, Any]  # the classifier, by the columns that name it
    frame: Frame
    axis: str
    shared: frozenset[Any] = frozenset()
    count: int = 0

    @cached_property
    def name(self) -> str:
        """The classifier in words."""
        columns = self.frame.columns
        return ", ".join(columns[key].text(v) for key, v in self.of.items() if not is_missing(v))

    @property
    def mean(self) -> float:
        """Mean of the main figure along the axis, at the values that all candidates have if any."""
        rows = self.frame.rows
        if self.axis and self.shared:
            rows = rows[rows[self.axis].isin(self.shared)]
        return float(rows[self.frame.figures[0]].mean())

    @property
    def complexity(self) -> tuple[Any, ...]:
        """Rank of the classifier, then of its sensor, by simplicity."""
        ranks = [SIMPLEST.index(v) if v in SIMPLEST else len(SIMPLEST) for v in self.of.values()]
        return ("both" in self.of.values(), *ranks)


def main_frame(frames: Mapping[str, Frame]) -> Frame:
    """Return the table of the headline: the scores of tests, or else the first table."""
    if SCORES not in frames:
        return next(iter(frames.values()))
    scores = frames[SCORES]
    return scores.where(scores.rows.kind.map(is_test))


def main_axis(frame: Frame, swept: Sequence[str]) -> str:
    """Return the column of the axis that results vary along; empty if there is none.

    Of the swept axes, the one with the longest curves, summed over candidates, numbers before
    words; without any, the number of frames, then the axis with the most numbers.
    """
    axes = [name for name in frame.varying_axes if name not in (frame.across, *word_axes(frame))]
    axes.sort(key=lambda name: name in frame.down)
    numeric = [name for name in axes if frame.rows[name].dtype.kind in "fiu"]
    swept_axes = [name for axis in swept for name in axes if frame.columns[name].axis == axis]
    swept_axes.sort(key=lambda name: -_count_steps(frame, name))
    longest = sorted(numeric, key=lambda name: -frame.rows[name].nunique())
    default = [name for name in numeric if name == DEFAULT_AXIS]
    return next(
        iter([*(n for n in swept_axes if n in numeric), *swept_axes, *default, *longest, *axes]), ""
    )


def rank_candidates(frame: Frame, axis: str) -> list[Candidate]:
    """Return the candidates of a table that have results along an axis.

    Rank percentages with a level of chance by their mean, at the values of the axis that all
    candidates have (cells may have failed at others), and equal means by simplicity. Keep other
    figures in their order, after the preferred candidate.
    """
    figure = frame.figures[0]
    frame = frame.where(frame.rows[figure].notna())
    if frame.rows.empty:
        return []
    names = _name_columns(frame, axis)
    main = select_main(frame, [*names, *[axis] * bool(axis)])
    if across := main.across:
        first = preferred_value(main.columns[across].axis, values_of(main.rows, across))
        main = main.select(across, first)
    if "scored" in names and (main.rows.scored == SHIP).any():
        main = main.where(main.rows.scored == SHIP)
    groups = main.rows.groupby(names, dropna=False, sort=False) if names else [((), main.rows)]
    varying = [name for name in names if name in main.varying_axes]
    candidates = []
    for key, rows in groups:
        identity = {name: value for name, value in zip(names, key, strict=True) if name in varying}
        identity = identity or dict(zip(names, key, strict=True))
        candidates.append(_make_candidate(main.where(rows.index), identity, axis))
    if not frame.columns_of_role("chance", figure) or frame.rows[figure].dtype.kind not in "fiu":
        preferred_identity = {
            n: preferred_value(frame.columns[n].axis, values_of(main.rows, n)) for n in varying
        }
        return sorted(candidates, key=lambda candidate: candidate.of != preferred_identity)
    candidates = _add_shared_values(candidates)
    return sorted(candidates, key=lambda one: (-round(one.mean, 6), one.complexity))


def _add_shared_values(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates with `shared` and `count` set, from those that depend on the axis."""
    values = [{*candidate.frame.rows[candidate.axis]} for candidate in candidates if candidate.axis]
    if not values:
        return list(candidates)
    shared, count = frozenset(set.intersection(*values)), len(set.union(*values))
    return [replace(candidate, shared=shared, count=count) for candidate in candidates]


def _count_steps(frame: Frame, axis: str) -> int:
    """Return the number of steps along an axis in the curves of all candidates."""
    names = _name_columns(frame, axis)
    groups = frame.rows.groupby(names, dropna=False) if names else [((), frame.rows)]
    return sum(max(rows[axis].nunique() - 1, 0) for _, rows in groups)


def _name_columns(frame: Frame, axis: str) -> list[str]:
    """Return the columns that name a candidate: declared columns of words, else the first one."""
    names = [name for name in frame.down if frame.rows[name].dtype == object and name != axis]
    if names or frame.down:
        return names
    words = [n for n in frame.varying_axes if frame.rows[n].dtype == object]
    return [name for name in words if name not in (axis, frame.across)][:1]


def _make_candidate(frame: Frame, identity: Mapping[str, Any], axis: str) -> Candidate:
    """Return a candidate with one row for each value of the axis that its results depend on."""
    depends_on_axis = bool(axis) and bool(frame.rows[axis].notna().any())
    if not depends_on_axis:
        return Candidate(identity, frame.where(frame.rows.index[:1]), "")
    rows = frame.rows[frame.rows[axis].notna()].drop_duplicates(axis)
    if pd.api.types.is_numeric_dtype(rows[axis]):
        rows = rows.sort_values(axis)
    return Candidate(identity, frame.where(rows.index), axis)
