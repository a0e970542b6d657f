"""What stands beside a sweep's figures: the article's, and the bound of the best classifier."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import pandas as pd
import yaml

from ncti import ships
from sweeps.engine.kinds import Draws
from sweeps.engine.settings import Settings, flatten
from sweeps.report.words import missing
from sweeps.stages.acn import Network
from sweeps.stages.classifier import Classifier, RandomAspects
from sweeps.stages.infrared import Infrared
from sweeps.stages.ladar import Ladar
from sweeps.stages.mnn import Mnn
from sweeps.stages.views import Grid, Scene

if TYPE_CHECKING:
    from sweeps.report.frames import Frame, Part

GROUPS: dict[str, tuple[type[Settings], ...]] = {
    "acn": (Scene, Ladar, Classifier, Network),
    "mnn": (Scene, Ladar, Classifier, Mnn),
    "acn_infrared": (Scene, Infrared, Classifier, Network),
}
"""Settings that must be the default, the article's, by its tables; `_percent` checks the grid's."""

TABLES = {"acn": "table4", "mnn": "table2", "acn_infrared": "table5"}
SAME = ("vigilance", "pulse_width", "frame_count")  # of these tables, where they name it
POSITIONS = {"shifted": 4}  # of the detector, with as many frames at each
BOUND = "likelihood"
OF_BOUND = ("classifier", "channel", "gain_sigma", "frame_count")  # columns that it needs
Row = Mapping[str, Any]


@lru_cache
def source_figures() -> dict[str, Any]:
    """Return the figures of the article."""
    text = files("sweeps.report").joinpath("source_figures.yaml").read_text(encoding="utf-8")
    figures: dict[str, Any] = yaml.safe_load(text)
    return figures


def with_comparisons(frame: Frame, attributes: Mapping[str, Any]) -> Frame:
    """Return a frame with the article's figures where they may be compared, and the bound."""
    frame = _with_bound(_with_frames_in_all(frame))
    main = frame.of_role("figure")
    shared = {"aspect_bin", "receiver", "aspects"}
    axes = {frame.columns[name].axis: name for name in frame.of_role("axis")}
    found: dict[str, list[Any]] = {name: [None] * len(frame.rows) for name in main}
    fair = [
        Comparison(part, attributes).is_fair if part.display.source else None
        for part in frame.parts
    ]
    used = {axis: frame.rows[name].tolist() for axis, name in axes.items()}
    for number, k in enumerate(frame.rows["part"].tolist()):
        part, test = frame.parts[k], fair[k]
        if test is None:
            continue
        row = {axis: None if missing(v[number]) else v[number] for axis, v in used.items()}
        row = {"receiver": part.attrs.get("receiver")} | {
            axis: value for axis, value in row.items() if value is not None or axis in shared
        }
        for name, value in _figures(frame.name, part.display.source, row, test).items():
            if name in found:
                found[name][number] = value
    for name, values in found.items():
        if any(value is not None for value in values):
            numbers = pd.to_numeric(pd.Series(values, index=frame.rows.index, dtype=object))
            frame = _with_column(frame, name, f"source_{name}", "source", numbers)
    return frame


def _figures(table: str, source: str, row: Row, is_fair: Callable[[Row], bool]) -> dict[str, Any]:
    """Return the article's figures for a row, by the columns that they stand beside."""
    given = source_figures()
    if source == "sensor":
        if row.get("frame_count") != given["table1_sensor"]["frame_count"]:
            return {}
        printed = given["table1_sensor"]["ranges"].get(row.get("range"), {})
        return {name.partition("_")[0]: float(value) for name, value in printed.items()}
    if source not in GROUPS or not is_fair(row):
        return {}
    if table == "scores":
        return {"percent_correct": _percent(source, row)}
    of_profiles, of_silhouettes = given["table3_categories"], given["table5_percent_correct"]
    if source == "acn_infrared" and row.get("vigilance") == of_silhouettes["vigilance"]:
        return {"categories": of_silhouettes["categories"]}
    same = source == "acn" and row.get("vigilance") == of_profiles["vigilance"]
    if same and _has_source_range(row):
        return {"categories": of_profiles["categories"].get(row.get("pulse_width"))}
    return {}


def _has_source_range(row: Row) -> bool:
    given = source_figures()["experiment"]
    return (row.get("range"), row.get("receiver")) == (given["range"], given["receiver"])


def _percent(source: str, row: Row) -> int | None:
    """Return the article's percent correct for a row, if it has one."""
    if row.get("aspects") not in (None, "learned"):  # the source tests the training aspects
        return None
    table, frames = source_figures()[f"{TABLES[source]}_percent_correct"], row.get("frame_count")
    if any(name in table and row.get(name) != table[name] for name in SAME):
        return None
    whole = row.get("aspect_bin") == "overall"
    figures: Any
    if source == "acn_infrared":
        way, slant_range = row.get("super_resolution"), row.get("range")
        if whole:
            found: int | None = table["overall"].get(way, {}).get(slant_range)
            return found
        figures = table.get(way, {}).get(slant_range)
    elif not _has_source_range(row):
        return None
    else:
        figures = table["training"] if frames is None else table["frames"].get(frames)
    first = re.match(r"-?[\d.]+", str(row.get("aspect_bin")))
    if figures is None or whole or first is None or float(first[0]) > 90:
        return None
    lowest = float(first[0])
    percent: int = figures[sum(lowest >= start for start in table["bin_starts"]) - 1]
    return percent


class Comparison:
    """Test of rows of a part of a table: whether they are at the article's settings."""

    def __init__(self, part: Part, attributes: Mapping[str, Any]) -> None:
        source = part.display.source
        self._swept: dict[str, set[Any]] = {}  # default values of settings with others, too
        self._possible = source in GROUPS and _has_source_views(part, attributes)
        for setting, written in _checked(source, attributes) if self._possible else ():
            given, default = set(setting.values(written)), set(setting.values(setting.default))
            self._possible &= bool(given & default)
            if given - default:
                self._swept[setting.name] = default

    def is_fair(self, row: Row) -> bool:
        """Return whether a row is at the article's settings, or does not depend on them."""
        return self._possible and all(
            row.get(name) is None or row[name] in default for name, default in self._swept.items()
        )


def _checked(source: str, attributes: Mapping[str, Any]) -> Iterator[tuple[Any, Any]]:
    """Yield the settings that a comparison depends on, with their values as configured."""
    settings = {
        one.key: one
        for group in GROUPS[source]
        for one in group.declared
        if one.fallback is None and one is not Classifier.name and not isinstance(one.kind, Draws)
    }
    for key, written in flatten(settings.values(), attributes.get("configuration", {})).items():
        yield settings[key], written


def _has_source_views(part: Part, attributes: Mapping[str, Any]) -> bool:
    """Return whether a table is of the article's own ships, as packaged, and of its aspects."""
    given = flatten(
        (Grid.aspect, RandomAspects.random_aspects), attributes.get("configuration", {})
    )
    aspects = set(Grid.aspect.values(given.get(Grid.aspect.key, Grid.aspect.default)))
    theirs = set(Grid.aspect.values(Grid.aspect.default))
    drawn = given.get(
        RandomAspects.random_aspects.key, RandomAspects.random_aspects.default
    )  # tested apart from the others
    return (
        part.attrs.get("views") in (None, len(_packaged()) * len(theirs))  # fewer if some failed
        and theirs <= aspects
        and len(aspects) == len(theirs) + drawn
        and sorted(attributes.get("mesh_digests", {}).values()) == sorted(_packaged())
    )


@lru_cache
def _packaged() -> tuple[str, ...]:
    """Return the digests of the article's ships."""
    return tuple(ships.digest(str(one)) for one in Grid.ship.values(Grid.ship.default))


def _with_column(frame: Frame, figure: str, name: str, role: str, values: pd.Series) -> Frame:
    """Return a frame with a column that belongs to a figure."""
    of, words = frame.columns[figure], name.replace("_", " ")
    column = replace(of, name=name, axis=figure, words=words, meaning="", role=role)
    return replace(
        frame, rows=frame.rows.assign(**{name: values}), columns={**frame.columns, name: column}
    )


def _with_frames_in_all(frame: Frame) -> Frame:
    """Return a frame with all frames of an image: those at every position of the detector."""
    axes = {frame.columns[name].axis: name for name in frame.of_role("axis")}
    if "super_resolution" not in axes:
        return frame
    counts = frame.rows[axes.get("infrared_frame_count", axes["frame_count"])]
    places = frame.rows[axes["super_resolution"]].map(lambda way: POSITIONS.get(way, 1))
    if "infrared_frame_count" in axes and "frame_count" in axes:
        counts = counts.fillna(frame.rows[axes["frame_count"]])
    whole = (counts * places).where(frame.rows[axes["super_resolution"]].notna())
    return _with_column(frame, frame.of_role("figure")[0], "frames_in_all", "beside", whole)


def _with_bound(frame: Frame) -> Frame:
    """Return scores with their distance from maximum likelihood, the best classifier possible.

    The bound knows mean and covariance of every view exactly, and of the gain the least that was
    swept; the true aspect is left out if the row's classifier leaves it out.
    """
    rows, figure = frame.rows, "percent_correct"
    if frame.name != "scores" or not {*OF_BOUND} <= set(rows):
        return frame
    tests = rows[(rows.kind == "test") & (rows.channel == "range") & (rows.classifier != "fusion")]
    tests = tests[tests.frame_count.notna()]
    bound = tests[tests.classifier == BOUND]
    if bound.empty:
        return frame
    gain = bound.gain_sigma.max()
    bound = bound[bound.gain_sigma == gain]
    axes = [name for name in frame.of_role("axis") if bound[name].nunique() > 1]
    keys = list(dict.fromkeys([*axes, "left_out"] if "left_out" in rows else axes))

    def placed(which: pd.DataFrame) -> pd.Series:
        given = which[keys].copy()
        if "left_out" in given:
            given["left_out"] = given["left_out"].fillna(False).astype(bool)
        return given.astype(object).apply(tuple, axis=1)

    best = dict(zip(placed(bound), bound[figure].map(_tenths), strict=True))
    scored = tests[(tests.scored == "ship") & tests[figure].notna()]
    if "score_rule" in scored:
        scored = scored[scored.score_rule.isna() | (scored.score_rule == "ship")]
    level = placed(scored).map(best)
    points = (level - scored[figure].map(_tenths)).dropna().map(_tenths)
    frame = _with_column(frame, figure, "points_below_bound", "beside", points.reindex(rows.index))
    gains = pd.Series(float(gain), index=points.index).reindex(rows.index)
    return _with_column(frame, figure, "bound_gain_sigma", "beside", gains)


def _tenths(value: float) -> float:
    """Return a percentage as it is in files."""
    return round(value, 1)
