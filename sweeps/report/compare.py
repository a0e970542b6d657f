"""Stores compared with a first one: paired differences of percent correct, and other figures'."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from ncti.text import printable
from sweeps.engine.declare.display import Display, Figure
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import PathOrUrl, path_beside
from sweeps.report.frames import (
    PART,
    Column,
    Frame,
    Part,
    read_frames,
    stack_frames,
    tidy_frame,
    values_of,
)
from sweeps.report.pairs import ANSWERS, Pairs, answers_of, holm, pair_answers
from sweeps.report.ranking import SCORES, is_test
from sweeps.report.stores import list_groups, open_store

NAME, STORE = "differences", "store"
BOTH_STORES = FIRST_STORE, SECOND_STORE = "first", "second"
DISPLAY = Display(
    NAME,
    "Ships identified correctly [points]",
    (
        Figure(
            "difference",
            low="ci_low",
            high="ci_high",
            extra_columns={name: name for name in ("n", "discordant", "significant")},
            percent=True,
            format="+.0f",
        ),
        Figure(FIRST_STORE, percent=True, format=".0f"),
        Figure(SECOND_STORE, percent=True, format=".0f"),
    ),
    rows=(STORE, "classifier", "channel", "scored", "aspects"),
    columns="aspect_bin",
    notes=("Computed on views present in both stores; 95 % intervals of paired differences.",),
)


@dataclass(frozen=True)
class Comparison:
    """Stores compared with the first: their names, and differences by table.

    Attributes
    ----------
    paths : tuple of Path or str
        Stores.
    names : tuple of str
        Their names, which differ.
    frames : mapping of str to Frame
        Differences that are not all 0, those of percent correct first.
    number, significant : int
        Comparisons over all aspects, and how many are significant by `holm`.
    """

    paths: tuple[PathOrUrl, ...]
    names: tuple[str, ...]
    frames: Mapping[str, Frame]
    number: int = 0
    significant: int = 0

    @property
    def output_path(self) -> Path:
        """Path from which outputs of a comparison take their names: `b-less-a.zarr`, beside b."""
        first, *others = (
            re.sub(r"(\.zarr)?/|\.zarr$", "-", name).strip("-") for name in self.names
        )
        return path_beside(self.paths[1]).with_name(f"{'-'.join(others)}-less-{first}.zarr")


def compare(first: PathOrUrl, *others: PathOrUrl) -> Comparison:
    """Return differences by table, other stores less the first, percent correct first.

    Answers are paired over the settings, ships, aspects and draws that both stores have. A setting
    with one value in each store does not prevent pairing, even if the two values differ. Other
    tables contain the differences of their figures, without intervals. Rows and tables without any
    difference are omitted.

    Raises
    ------
    ConfigurationError
        If a store is given twice, has no tables, or has nothing in common with the first.
    """
    paths = first, *others
    names, first_frames = store_names(paths), read_frames(first)
    comparisons: list[tuple[Display, Pairs]] = []
    tables: dict[str, list[Frame]] = {NAME: []}
    for path, name in zip(others, names[1:], strict=True):
        second_frames, labels = read_frames(path), {STORE: name} if len(others) > 1 else {}
        pairs = _pair_stores(first, first_frames, path, second_frames, labels)
        differences = [
            _subtract_frames(first_frames[shared], second_frames[shared], labels)
            for shared in second_frames
            if shared in first_frames and shared != SCORES
        ]
        subtracted = [table for table in differences if len(table.rows) and table.figures]
        if not pairs and not subtracted:
            raise ConfigurationError(
                _no_overlap_reason(names[0], first_frames, name, second_frames)
            )
        comparisons += pairs
        for table in subtracted:
            tables.setdefault(table.name, []).append(table)
    significant, number = holm(
        [answers for display, answers in comparisons if _has_test_scores(display)]
    )
    of_tests = iter(significant)
    for display, answers in comparisons:
        dataset = answers.tabulate(next(of_tests) if _has_test_scores(display) else None)
        tables[NAME].append(tidy_frame(dataset, display, ""))
    changed = [_keep_changes(stack_frames(parts)) for parts in tables.values() if parts]
    frames = {frame.name: _name_stores(frame, names) for frame in changed if frame is not None}
    count = sum(int(cells.sum()) for cells in significant)
    return Comparison(paths, names, frames, number, count)


def _has_test_scores(display: Display) -> bool:
    return is_test(display.labels.get("kind"))


def _pair_stores(
    first: PathOrUrl,
    first_frames: Mapping[str, Frame],
    second: PathOrUrl,
    second_frames: Mapping[str, Frame],
    labels: Mapping[str, str],
) -> list[tuple[Display, Pairs]]:
    """Return the common answers of each part of two stores' scores, with their displays."""
    first_parts = _answer_parts(first, first_frames)
    common = []
    for key, part in _answer_parts(second, second_frames).items():
        if key in first_parts:
            pairs = pair_answers(answers_of(first, first_parts[key]), answers_of(second, part))
            display = replace(DISPLAY, labels={**labels, **part.display.labels})
            common += [(display, pairs)] if pairs is not None else []
    return common


def store_names(paths: Sequence[PathOrUrl]) -> tuple[str, ...]:
    """Return distinct names of stores, preceded by as many folders as distinguish them.

    Raises ConfigurationError if a store is given twice.
    """
    stores = [path_beside(path) if isinstance(path, Path) else Path(str(path)) for path in paths]
    resolved = [store.resolve() for store in stores]
    for path in resolved:
        if resolved.count(path) > 1:
            raise ConfigurationError(f"{str(path)!r} is given twice; give two different stores")
    for count in range(1, max(len(store.parts) for store in stores) + 1):
        names = tuple(printable("/".join(store.parts[-count:])) for store in stores)
        if len(set(names)) == len(names):
            break
    return names


def _no_overlap_reason(
    first: str, first_frames: Mapping[str, Frame], second: str, second_frames: Mapping[str, Frame]
) -> str:
    """Return why stores cannot be compared: they share no table or no value of an axis."""
    for table in (name for name in second_frames if name in first_frames):
        frames = first_frames[table], second_frames[table]
        for axis in (name for name in frames[1].place_columns if name in frames[0].columns):
            values = [values_of(frame.rows, axis) for frame in frames]
            if all(values) and not {*values[0]} & {*values[1]}:
                column = frames[0].columns[axis]
                has, have = (", ".join(map(column.text, axis_values[:3])) for axis_values in values)
                return (
                    f"stores must have a value of {column.words} in common, but {first} has {has} "
                    f"and {second} has {have}"
                )
    return (
        "stores must have a table with answers to the same views in common, "
        f"but {first} has {', '.join(first_frames)} and {second} has {', '.join(second_frames)}"
    )


def _subtract_frames(first: Frame, second: Frame, labels: Mapping[str, str]) -> Frame:
    """Return the figures of a table, second less first, at the places that both frames have.

    Rows need not agree on an axis with one value in each frame, unless it is a label, such as the
    classifier.
    """
    figures = [
        name
        for name in second.figures
        if name in first.figures and second.rows[name].dtype.kind in "fiu"
    ]
    axes = [name for name in second.place_columns if name in first.place_columns]
    labelled = {name for part in (*first.parts, *second.parts) for name in part.display.labels}
    varying = {n for frame in (first, second) for n in axes if frame.rows[n].nunique() > 1}
    shared = [name for name in axes if name in varying | labelled]
    places = [name for name in second.place_columns if name in shared or name not in axes]
    # A constant part number is a merge key even if the frames share no axis.
    first_rows = first.rows.assign(**{PART: 0})[[PART, *shared, *figures]]
    second_rows = second.rows.assign(**{PART: 0})[[PART, *places, *figures]]
    rows = second_rows.merge(first_rows, on=[PART, *shared], suffixes=("", f"_{FIRST_STORE}"))
    columns = {name: Column(name, name, name) for name in labels}
    columns |= {name: second.columns[name] for name in places}
    for name in figures:
        column, ends = second.columns[name], (f"{name}_{FIRST_STORE}", f"{name}_{SECOND_STORE}")
        rows[ends[1]] = rows[name]
        rows[name] = rows[name] - rows[ends[0]]
        columns[name] = replace(column, format="+.0f" if column.unit == "%" else "+.3g")
        columns |= {
            end: replace(column, name=end, axis=name, role="beside", listed=False) for end in ends
        }
    part = replace(
        second.parts[0], group="", display=replace(second.parts[0].display, labels=labels)
    )
    return replace(
        second,
        name=f"{second.name}_{NAME}",
        rows=rows.assign(**labels)[[PART, *columns]],
        columns=columns,
        parts=(part,),
        down=(*labels, *(name for name in second.down if name in columns)),
        across=second.across if second.across in columns else "",
        notes=(),
    )


def _keep_changes(frame: Frame) -> Frame | None:
    """Return a table of differences without the figures and curves in which nothing differs."""
    if frame.name == NAME:
        figures, changed = frame.figures, frame.rows.discordant > 0
    else:
        values = pd.DataFrame({name: differing_rows(frame, name) for name in frame.figures})
        figures = [name for name in frame.figures if values[name].any()]
        changed = values.any(axis=1)
    if not changed.any():
        return None
    curves = [name for name in (*frame.down, "kind") if name in frame.columns]
    rows = frame.rows
    if curves:
        curve_keys = [frame.rows[name] for name in curves]
        rows = rows[changed.groupby(curve_keys, dropna=False).transform("any").astype(bool)]
    dropped = {*frame.figures} - {*figures}
    columns = {n: c for n, c in frame.columns.items() if not {n, c.axis} & dropped}
    return replace(frame, rows=rows[[PART, *columns]].reset_index(drop=True), columns=columns)


def differing_rows(frame: Frame, figure: str) -> pd.Series:
    """Return a mask of rows in which a figure differs, or only one store has a value."""
    first, second = (frame.rows[f"{figure}_{end}"] for end in BOTH_STORES)
    return (first != second) & (first.notna() | second.notna())


def _name_stores(frame: Frame, names: Sequence[str]) -> Frame:
    """Return a table of differences with the names of the stores in its title and columns."""
    first, *others = names
    columns = dict(frame.columns)
    if frame.name == NAME:
        columns["difference"] = replace(columns["difference"], unit="points")
        words = first, others[0] if len(others) == 1 else "the other store"
        for end, name in zip(BOTH_STORES, words, strict=True):
            columns[end] = replace(columns[end], words=name)
    minuend = others[0] if len(others) == 1 else "other stores"
    return replace(frame, title=f"{frame.title}: {minuend} less {first}", columns=columns)


def _answer_parts(path: PathOrUrl, frames: Mapping[str, Frame]) -> dict[tuple[Any, ...], Part]:
    """Return the parts of a store's scores that count answers, by what identifies them."""
    answered = list_groups(open_store(path), "classification")
    return {
        (part.group, part.display.figures[0].variable, *sorted(part.display.labels.items())): part
        for part in (frames[SCORES].parts if SCORES in frames else ())
        if part.group.removeprefix("tables/") in answered
        if part.display.figures[0].variable in ANSWERS
    }
