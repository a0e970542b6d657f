"""Columns beside a sweep's figures: the article's, and the bound of the best classifier."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import pandas as pd
import yaml

from ncti import ships
from ncti.article import article_figures
from ncti.evaluate.scores import BIN_WIDTH
from sweeps.engine.declare.kinds import Draws
from sweeps.engine.declare.settings import Settings, flatten
from sweeps.report.words import is_missing
from sweeps.stages.acn import Network
from sweeps.stages.classifier import Classifier, RandomAspects, draw_aspects
from sweeps.stages.infrared import Infrared
from sweeps.stages.ladar import CORNER, Ladar
from sweeps.stages.mnn import Mnn
from sweeps.stages.views import Grid, Scene

if TYPE_CHECKING:
    from sweeps.report.frames import Frame, Part

GROUPS: dict[str, tuple[type[Settings], ...]] = {
    "acn": (Scene, Ladar, Classifier, Network),
    "mnn": (Scene, Ladar, Classifier, Mnn),
    "acn_infrared": (Scene, Infrared, Classifier, Network),
}
"""Settings that must have the article's values, by table; the grid is checked separately."""

ARTICLE_VALUES = {Ladar.place: CORNER}
"""The article's values of settings whose default is another."""

SENSOR_TABLE = "sensor"  # the article's table of the sensor, which is compared at any setting
LEARNED_ASPECTS = "learned"  # aspects that the article tests
BIN_STARTS = (0, 30, 60)  # deg, lowest aspects of the article's bins
DETECTOR_POSITIONS = {"shifted": 4}  # of the detector, with as many frames at each
BOUND = "likelihood"
BOUND_COLUMNS = ("classifier", "channel", "gain_sigma", "frame_count")  # columns that it needs


@lru_cache
def _printed_figures() -> dict[str, list[tuple[str, dict[str, Any], float]]]:
    """Return the article's figures by table: tuples of column, values of axes, and number.

    They are the figures that tables print beside a sweep's, declared in `article_columns.yaml`.
    Aspect bins are named by their lowest aspect [deg].
    """
    text = files("sweeps.report").joinpath("article_columns.yaml").read_text(encoding="utf-8")
    printed: dict[str, list[tuple[str, dict[str, Any], float]]] = {}
    for comparison in yaml.safe_load(text)["beside"]:
        figures = article_figures()[comparison["of"]][comparison["figures"]]
        for axis_values, value in _iter_nested(figures, comparison["by"], comparison["at"]):
            column = comparison.get("column") or axis_values.pop("column").partition("_")[0]
            number = float(value) if isinstance(value, str) else value
            printed.setdefault(comparison["table"], []).append((column, axis_values, number))
    return printed


def _iter_nested(
    figures: Any, axes: Sequence[str], axis_values: Mapping[str, Any]
) -> Iterator[tuple[dict[str, Any], Any]]:
    """Yield the values of axes and the number of each figure in mappings nested by `axes`."""
    if not axes:
        yield dict(axis_values), figures
        return
    values = zip(BIN_STARTS, figures, strict=True) if axes[0] == "bin" else figures.items()
    for value, inner in values:
        yield from _iter_nested(inner, axes[1:], {**axis_values, axes[0]: value})


def add_comparisons(frame: Frame, attributes: Mapping[str, Any]) -> Frame:
    """Return a frame with the article's figures where they may be compared, and the bound."""
    frame = _add_bound(_add_total_frames(frame))
    axes = frame.names_by_axis
    article_numbers: dict[str, dict[Any, float]] = {
        name: {} for name in frame.columns_of_role("figure")
    }
    for number, part in enumerate(frame.parts):
        values_of = _article_values(part, attributes)
        if values_of is None:
            continue
        printed = _printed_figures().get(part.display.source, [])
        for label in frame.rows.index[frame.rows["part"] == number]:
            values = frame.records[label]
            row = {
                axis: values[name] for axis, name in axes.items() if not is_missing(values[name])
            }
            if any(row.get(name) not in (None, *allowed) for name, allowed in values_of.items()):
                continue
            row = {"receiver": part.attrs.get("receiver"), "aspects": LEARNED_ASPECTS} | row
            row["bin"] = _bin_start(str(row.get("aspect_bin")))
            for figure, axis_values, value in printed:
                if figure in article_numbers and all(
                    row.get(name) == value for name, value in axis_values.items()
                ):
                    article_numbers[figure][label] = value
    for name, values in article_numbers.items():
        if values:
            numbers = pd.Series(values).reindex(frame.rows.index)
            frame = _add_column(frame, name, f"article_{name}", "article", numbers)
    return frame


def _bin_start(label: str) -> Any:
    """Return the lowest aspect [deg] of the article's bin that contains the start of ours."""
    lowest = re.match(r"[\d.]+", label)
    if lowest is None or float(lowest[0]) > BIN_STARTS[-1] + BIN_WIDTH:
        return label
    return min(BIN_WIDTH * (float(lowest[0]) // BIN_WIDTH), BIN_STARTS[-1])


def _article_values(part: Part, attributes: Mapping[str, Any]) -> dict[str, set[Any]] | None:
    """Return the article's values, by name, of settings that a part also sweeps over others.

    None if the part cannot be compared, or a setting lacks the article's values.
    """
    source = part.display.source
    if source == SENSOR_TABLE:
        return {}
    if source not in GROUPS or not _covers_article_views(part, attributes):
        return None
    settings = {setting.key: setting for group in GROUPS[source] for setting in group.declared}
    values_of = {}
    for key, value in flatten(settings.values(), attributes.get("configuration", {})).items():
        setting = settings[key]
        derived = setting.fallback is not None or isinstance(setting.kind, Draws)
        if derived or setting is Classifier.name:
            continue
        values = set(setting.values(value))
        article_values = set(setting.values(ARTICLE_VALUES.get(setting, setting.default)))
        if not values & article_values:
            return None
        if values - article_values:
            values_of[setting.name] = article_values
    return values_of


def _covers_article_views(part: Part, attributes: Mapping[str, Any]) -> bool:
    """Return whether a table covers the packaged ships of the article and its aspects."""
    configured = flatten(
        (Grid.aspect, RandomAspects.random_aspects), attributes.get("configuration", {})
    )
    aspects = set(Grid.aspect.values(configured.get(Grid.aspect.key, Grid.aspect.default)))
    article_aspects = set(Grid.aspect.values(Grid.aspect.default))
    # Random aspects are tested apart from the others.
    number = configured.get(RandomAspects.random_aspects.key, RandomAspects.random_aspects.default)
    drawn = draw_aspects(min(aspects), max(aspects), number, attributes.get("seed", 0))
    return (
        part.attrs.get("views")
        in (None, len(_packaged_digests()) * len(article_aspects))  # fewer if some failed
        and aspects == article_aspects | set(drawn)
        and not attributes.get("mesh_transforms")
        and sorted(attributes.get("mesh_digests", {}).values()) == sorted(_packaged_digests())
    )


@lru_cache
def _packaged_digests() -> tuple[str, ...]:
    """Return the digests of the article's ships."""
    return tuple(ships.digest(str(ship)) for ship in Grid.ship.values(Grid.ship.default))


def _add_column(frame: Frame, figure: str, name: str, role: str, values: pd.Series) -> Frame:
    """Return a frame with a column that belongs to a figure."""
    figure_column, words = frame.columns[figure], name.replace("_", " ")
    column = replace(figure_column, name=name, axis=figure, words=words, meaning="", role=role)
    return replace(
        frame, rows=frame.rows.assign(**{name: values}), columns={**frame.columns, name: column}
    )


def _add_total_frames(frame: Frame) -> Frame:
    """Return a frame with the number of frames of an image over all detector positions."""
    axes = frame.names_by_axis
    if "super_resolution" not in axes:
        return frame
    counts = frame.rows[axes.get("infrared_frame_count", axes["frame_count"])]
    positions = frame.rows[axes["super_resolution"]].map(lambda way: DETECTOR_POSITIONS.get(way, 1))
    if "infrared_frame_count" in axes and "frame_count" in axes:
        counts = counts.fillna(frame.rows[axes["frame_count"]])
    totals = (counts * positions).where(frame.rows[axes["super_resolution"]].notna())
    return _add_column(frame, frame.columns_of_role("figure")[0], "frames_in_all", "beside", totals)


def _add_bound(frame: Frame) -> Frame:
    """Return scores with their distance from maximum likelihood, the best classifier possible.

    The bound knows mean and covariance of every view exactly. It uses the largest swept
    `gain_sigma`, that is, the weakest prior on the gain. It leaves the true aspect out of training
    where the row's classifier does.
    """
    rows, figure = frame.rows, "percent_correct"
    if frame.name != "scores" or not {*BOUND_COLUMNS} <= set(rows):
        return frame
    tests = rows[(rows.kind == "test") & (rows.channel == "range") & (rows.classifier != "fusion")]
    tests = tests[tests.frame_count.notna()]
    if "left_out" in tests:
        tests = tests.assign(left_out=tests.left_out.fillna(False).astype(bool))
    bound = tests[tests.classifier == BOUND]
    if bound.empty:
        return frame
    gain = bound.gain_sigma.max()
    bound = bound[bound.gain_sigma == gain]
    axes = [name for name in frame.columns_of_role("axis") if bound[name].nunique() > 1]
    keys = [*dict.fromkeys(["kind", *axes, *({"left_out"} & {*tests})])]
    scored = tests[(tests.scored == "ship") & tests[figure].notna()]
    if "score_rule" in scored:
        scored = scored[scored.score_rule.isna() | (scored.score_rule == "ship")]
    best = scored[keys].merge(bound[[*keys, figure]], how="left", on=keys)[figure]
    level = best.set_axis(scored.index).map(_round_to_tenths)
    points = (level - scored[figure].map(_round_to_tenths)).dropna().map(_round_to_tenths)
    frame = _add_column(frame, figure, "points_below_bound", "beside", points.reindex(rows.index))
    gains = pd.Series(float(gain), index=points.index).reindex(rows.index)
    return _add_column(frame, figure, "bound_gain_sigma", "beside", gains)


def _round_to_tenths(value: float) -> float:
    """Return a percentage as it is in files."""
    return round(value, 1)
