"""Two stores compared: paired differences of percent correct, and differences of other figures."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import xarray as xr

from ncti.evaluate import paired_difference
from ncti.evaluate.answers import DRAWS, OF_ASPECTS, VIEW, by_bin
from sweeps.engine.declare.display import Display, Figure
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import PathOrUrl, path_beside
from sweeps.report.frames import PART, Frame, Part, read_frames, stacked, tidy
from sweeps.report.stores import attributes, groups, opened, read
from sweeps.report.words import MAIN, printable
from sweeps.stages.classifier import drawn_aspects, kinds_of_aspects

NAME = "differences"
SCORES = "scores"
ANSWERS = {
    "accuracy": "correct",
    "ship_accuracy": "ship_correct",
    "training_accuracy": "training_correct",
}
"""Variables of answers by those of their scores."""
MARKED = ("range_profile", "infrared")  # groups that say which aspects are learned
DISPLAY = Display(
    NAME,
    "Ships identified correctly [points]",
    (
        Figure(
            "difference",
            low="ci_low",
            high="ci_high",
            beside={"n": "n"},
            percent=True,
            format="+.0f",
        ),
    ),
    rows=("classifier", "channel", "scored", "aspects"),
    columns="aspect_bin",
    notes=("Of the views that both have, with 95 % intervals of paired answers.",),
)


def compare(first: PathOrUrl, second: PathOrUrl) -> dict[str, Frame]:
    """Return differences by table, second store less first, those of percent correct first.

    Answers are paired: of the settings, ships, aspects and draws that both stores have. A setting
    of one value in one store is compared with every value in the other. Other tables have the
    differences of their figures, without intervals.

    Raises
    ------
    ConfigurationError
        If a store has no tables, or the stores have nothing in common.
    """
    ours, theirs = read_frames(first), read_frames(second)
    stores = f"{printable(path_beside(second).name)} less {printable(path_beside(first).name)}"
    known = {_key(part): part for part in _scored(first, ours)}
    parts = []
    for part in _scored(second, theirs):
        if (other := known.get(_key(part))) is not None:
            table = _differences(_answers(first, other), _answers(second, part))
            title = f"{DISPLAY.title}: {stores}"
            display = replace(DISPLAY, title=title, labels=part.display.labels)
            parts.append(tidy(table, display, "") if table is not None else None)
    paired = [part for part in parts if part is not None]
    frames = {NAME: stacked(paired)} if paired else {}
    for name in (their for their in theirs if their in ours and their != SCORES):
        rest = _subtracted(ours[name], theirs[name], stores)
        frames |= {rest.name: rest} if len(rest.rows) and rest.figures else {}
    if not frames:
        raise ConfigurationError(
            f"store is {str(second)!r}, but must have answers in common with {str(first)!r}"
        )
    return frames


def compared_name(first: PathOrUrl, second: PathOrUrl) -> Path:
    """Return the path of the store that a comparison is named like: `b-less-a.zarr`, beside b."""
    ours, theirs = path_beside(first), path_beside(second)
    return theirs.with_name(f"{theirs.stem}-less-{ours.stem}.zarr")


def sentences(frames: Mapping[str, Frame]) -> list[str]:
    """Return in words which classifier differs most, over all aspects."""
    if NAME not in frames:
        return ["The stores have no answers of classifiers in common."]
    frame = frames[NAME]
    at = frame.at({frame.across: MAIN["aspect_bin"]}) if frame.across else frame
    rows = at.rows[(at.rows.kind == "test") & at.rows.difference.notna()]
    sure = rows[(rows.ci_low > 0) | (rows.ci_high < 0)]
    if sure.empty:
        return [f"No difference over all aspects is larger than its interval ({len(rows)} cells)."]
    row = sure.loc[sure.difference.abs().idxmax()]
    name = frame.columns["classifier"].text(row.classifier)
    return [
        f"{len(sure)} of {len(rows)} differences over all aspects are larger than their intervals; "
        f"the largest is {row.difference:+.0f} points [{row.ci_low:+.0f} to {row.ci_high:+.0f}], "
        f"of {name}."
    ]


def _subtracted(first: Frame, second: Frame, stores: str) -> Frame:
    """Return the figures of a table, second less first, at the places that both have."""
    figures = [
        name
        for name in second.figures
        if name in first.figures and second.rows[name].dtype.kind in "fiu"
    ]
    axes = [name for name in second.of_role("axis") if name in first.rows]
    shared = [name for name in axes if name in first.several and name in second.several]
    own = [name for name in axes if name not in first.several]
    names = [*dict.fromkeys([*shared, *own]), *figures]
    rows, others = (table.rows.assign(**{PART: 0}) for table in (second, first))
    others = others[[PART, *shared, *figures]]
    rows = rows[[PART, *names]].merge(others, on=[PART, *shared], suffixes=("", "_first"))
    columns = {name: second.columns[name] for name in names}
    for name in figures:
        rows[name] -= rows.pop(f"{name}_first")
        unit = columns[name].unit
        columns[name] = replace(columns[name], format="+.0f" if unit == "%" else "+.3g")
    return replace(
        second,
        name=f"{second.name}_{NAME}",
        title=f"{second.title}: {stores}",
        rows=rows,
        columns=columns,
        parts=(replace(second.parts[0], group=""),),
        notes=(),
    )


def _scored(path: PathOrUrl, frames: Mapping[str, Frame]) -> list[Part]:
    """Return the parts of the scores of a store that count answers."""
    answered = groups(opened(path), "classification")
    return [
        part
        for part in (frames[SCORES].parts if SCORES in frames else ())
        if part.group.removeprefix("tables/") in answered
        if part.display.figures[0].variable in ANSWERS
    ]


def _key(part: Part) -> tuple[Any, ...]:
    return part.group, part.display.figures[0].variable, *sorted(part.display.labels.items())


def _answers(path: PathOrUrl, part: Part) -> xr.DataArray:
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


def _differences(first: xr.DataArray, second: xr.DataArray) -> xr.Dataset | None:
    """Return the differences by aspect bin of the answers in common; None without any."""
    first, second = _with_dims(first, second.dims), _with_dims(second, first.dims)
    common = xr.align(first, second, join="inner")
    former, other = xr.broadcast(*(answers.reset_coords(drop=True) for answers in common))
    draws = [dim for dim in DRAWS if dim in former.dims]
    if 0 in former.shape or not {*VIEW} <= {*former.dims}:
        return None
    former, other = (answers.transpose(..., *draws, *VIEW) for answers in (former, other))
    asked = (former.values >= 0) & (other.values >= 0)
    right, aspects = (former.values == 1, other.values == 1), former.aspect.values
    difference = paired_difference(*right, aspects, draws=len(draws), answered=asked)
    figures = {
        "difference": (difference.fraction, "fraction of ships identified, second less first"),
        "ci_low": (difference.ci_low, "lower end of its 95 % interval"),
        "ci_high": (difference.ci_high, "upper end of its 95 % interval"),
        "n": (difference.n, "number of pairs of answers"),
    }
    return by_bin(former, difference.labels, figures)


def _with_dims(answers: xr.DataArray, dims: Iterable[Hashable]) -> xr.DataArray:
    """Return answers with dimensions that another store has, where they have one value there."""
    return answers.expand_dims(
        [dim for dim in dims if dim in answers.coords and dim not in answers.dims]
    )
