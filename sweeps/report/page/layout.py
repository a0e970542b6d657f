"""Tables and charts of a page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from sweeps.report.page.charts import Chart, chart
from sweeps.report.page.cubes import BIN, NAMED, SCORE, SPLIT, Axis, Cube, Place
from sweeps.report.tables import REJECTING, TITLES

PROFILES = {"training_": "training profiles", "ship_": "ship alone", "": ""}
CHANNELS = {"range": "range profile", "infrared": "silhouette", "both": "both sensors"}
KINDS = {"learned": "learned", "test": "synthetic, noisy", "measured": "simulated flight"}
MOST = 60  # rows of a table; the CSV file has all
TABLES = {
    "acn": "the article's Table 4",
    "mnn": "the article's Table 2",
    "acn_infrared": "the article's Table 5",
}
OTHERS = {
    "acn": "the article's Table 3 for the categories",
    "detection": "the article's Table 1 for the sensor",
    "measured": "the article's Figures 14 to 16 for the profiles",
}


@dataclass(frozen=True)
class Cell:
    """A cell of a table: its cube, and its place on axes other than the selected ones."""

    cube: int
    at: Place


@dataclass(frozen=True)
class Line:
    """A row of a table."""

    label: str
    cells: list[Cell]
    notes: list[tuple[str, str, str]] = field(default_factory=list)


@dataclass(frozen=True)
class Sheet:
    """A table of the page; `by` is the axis of its rows, and equal `part`s are variants."""

    caption: str
    heading: str
    columns: list[str]
    lines: list[Line]
    by: str = ""
    part: str = ""
    shown: bool = True
    more: int = 0
    measures: bool = False


@dataclass(frozen=True)
class Section:
    """Tables and charts of one group of a store."""

    name: str
    title: str
    sheets: list[Sheet]
    charts: list[Chart] = field(default_factory=list)
    meanings: list[tuple[str, str]] = field(default_factory=list)


def label_of(cube: Cube) -> str:
    """Return the label of a classifier's scores."""
    name = cube.group.rpartition("/")[2]
    prefix = cube.name.removesuffix(SCORE) if cube.name.endswith(SCORE) else ""
    own = f"{name}_{prefix.strip('_')}" if prefix else name
    first = TITLES.get(own) or TITLES.get(name) or REJECTING.get(name) or name.replace("_", " ")
    words = [first, "" if own in TITLES else PROFILES.get(prefix, prefix.strip("_"))]
    fixed = cube.fixed
    words += [CHANNELS.get(fixed["channel"], "")] if "channel" in fixed else []
    words += [fixed["classifier"].upper()] if "classifier" in fixed and name == "measured" else []
    words += [KINDS.get(fixed["kind"], fixed["kind"])] if "kind" in fixed else []
    return ", ".join(word for word in words if word)


def notes_of(cube: Cube, axes: Mapping[str, Axis]) -> list[tuple[str, str, str]]:
    """Return values of a cube on axes that have several elsewhere: axis, words and value."""
    return [
        (dim, axes[dim].words, text)
        for dim, text in cube.fixed.items()
        if dim in axes and len(axes[dim].texts) > 1 and dim != BIN and dim not in SPLIT
    ]


def is_training(cube: Cube) -> bool:
    """Return whether a cube scores training views."""
    return cube.name.startswith("training_")


def is_score(cube: Cube) -> bool:
    """Return whether a cube is percent correct by aspect bin."""
    return cube.name.endswith(SCORE) and BIN in cube.dims


def score_sections(
    cubes: Sequence[Cube], axes: Mapping[str, Axis]
) -> tuple[Sheet | None, list[Section]]:
    """Return the table of all classifiers, and a section for each classifier."""
    found = {number: cube for number, cube in enumerate(cubes) if is_score(cube)}
    if not found:
        return None, []
    tests = [number for number, cube in found.items() if not is_training(cube)]
    tests = tests or list(found)
    whole = Sheet(
        "Percent correct by aspect bin, every classifier",
        "classifier",
        list(axes[BIN].texts),
        [_score_line(number, cubes, axes) for number in tests],
    )
    sections = []
    for group in dict.fromkeys(cubes[number].group for number in found):
        own = [number for number in found if cubes[number].group == group]
        sheets = []
        for number in own:
            if not is_training(cubes[number]) or len(own) == 1:
                # Training views are scored like tests without a prefix.
                plain = cubes[number].name == SCORE
                trained = [other for other in own if plain and is_training(cubes[other])]
                sheets += _by_axis(number, trained, cubes, axes)
        name = group.rpartition("/")[2]
        sections.append(Section(name, title_of(name), sheets))
    return whole, sections


def title_of(name: str) -> str:
    """Return the title of a group's tables."""
    known = TITLES.get(name) or REJECTING.get(name)
    words = known.partition(",")[0] if known else name.replace("_", " ")
    return words[:1].upper() + words[1:]


def _score_line(number: int, cubes: Sequence[Cube], axes: Mapping[str, Axis]) -> Line:
    cells = [Cell(number, {BIN: place}) for place in range(len(axes[BIN].texts))]
    return Line(label_of(cubes[number]), cells, notes_of(cubes[number], axes))


def _by_axis(
    number: int, trained: Sequence[int], cubes: Sequence[Cube], axes: Mapping[str, Axis]
) -> list[Sheet]:
    """Return tables of one classifier by aspect bin, a row per value of one of its axes."""
    cube, bins = cubes[number], range(len(axes[BIN].texts))
    sheets = []
    keys = [dim for dim in cube.dims if dim != BIN]
    first = _main(keys, axes)
    for dim in keys or [""]:
        lines = [
            Line(
                axes[dim].texts[place] if dim else "all",
                [Cell(number, ({dim: place} if dim else {}) | {BIN: k}) for k in bins],
            )
            for place in (_places(cube, dim) if dim else (0,))
        ]
        lines += [
            Line("training", [Cell(one, {BIN: k}) for k in bins], notes_of(cubes[one], axes))
            for one in trained
            if dim not in cubes[one].dims and one != number
        ]
        name = cube.group.rpartition("/")[2]
        source = f"; beside it {TABLES[name]}" if cube.source and name in TABLES else ""
        by = f" by {axes[dim].words}" if dim else ""
        sheets.append(
            Sheet(
                f"Percent correct, {label_of(cube)}{by}{source}",
                axes[dim].label if dim else "",
                list(axes[BIN].texts),
                lines[:MOST],
                dim,
                f"{cube.group}/{cube.name}/{label_of(cube)}",
                dim == first,
                max(0, len(lines) - MOST),
            )
        )
    return sheets


def _main(keys: Sequence[str], axes: Mapping[str, Axis]) -> str:
    """Return the initial axis of rows: frames, else the longest numeric axis, or the longest."""
    if "frame_count" in keys:
        return "frame_count"
    ranks = {dim: (axes[dim].numbers is not None, len(axes[dim].texts)) for dim in keys}
    return max(keys, key=lambda dim: ranks[dim], default="")


def score_charts(cubes: Sequence[Cube], axes: Mapping[str, Axis]) -> list[Chart]:
    """Return charts of percent correct against every axis of several values."""
    found = [number for number, cube in enumerate(cubes) if is_score(cube)]
    tests = [number for number in found if not is_training(cubes[number])]
    colours = {number: k for k, number in enumerate(tests or found)}
    charts = []
    for name, axis in axes.items():
        lines = [number for number in colours if name in cubes[number].dims]
        if lines and len(axis.texts) > 1:
            texts = "Percent correct", "percent correct", [label_of(cubes[k]) for k in lines]
            looks = [colours[k] for k in lines]
            charts.append(chart(texts, axis, lines, looks, cubes, axes, (0.0, 100.0)))
    # The axes that most classifiers have come first.
    return sorted(charts, key=lambda one: -len(one.series))


def legend(cubes: Sequence[Cube]) -> list[tuple[int, str]]:
    """Return numbers of colours of charts of scores, with their classifiers."""
    found = [cube for cube in cubes if is_score(cube)]
    tests = [cube for cube in found if not is_training(cube)]
    return [(number, label_of(cube)) for number, cube in enumerate(tests or found)]


def other_sections(
    cubes: Sequence[Cube], axes: Mapping[str, Axis], titles: Mapping[str, str]
) -> list[Section]:
    """Return sections of all other variables, with a chart against each of their axes."""
    sections = []
    others = [
        number for number, cube in enumerate(cubes) if not is_score(cube) and NAMED not in cube.dims
    ]
    for group in dict.fromkeys(cubes[number].group for number in others):
        own = [number for number in others if cubes[number].group == group]
        name = group.rpartition("/")[2]
        sheets = _beside_each_other(own, cubes, axes, titles.get(group) or title_of(name), name)
        charts: list[Chart] = []
        for variable in dict.fromkeys(cubes[number].name for number in own):
            lines = [number for number in own if cubes[number].name == variable]
            if len({value for number in lines for value in cubes[number].values} - {None}) > 1:
                charts += _against_axes(lines, cubes, axes)
        meanings = dict.fromkeys((told(cubes[k]), cubes[k].long_name) for k in own)
        sections.append(
            Section(name, titles.get(group) or title_of(name), sheets, charts, list(meanings))
        )
    return sections


def _against_axes(
    lines: Sequence[int], cubes: Sequence[Cube], axes: Mapping[str, Axis]
) -> Iterator[Chart]:
    """Yield charts of one variable, a curve per value of split axes."""
    first = cubes[lines[0]]
    names = [", ".join(_split(cubes[number])) for number in lines]
    for dim in first.dims:
        texts = first.label, first.units or first.label, names
        yield chart(texts, axes[dim], lines, range(len(lines)), cubes, axes)


def told(cube: Cube) -> str:
    """Return the name of a variable, with its place on axes that are split."""
    return ", ".join((cube.label, *_split(cube)))


def _split(cube: Cube) -> list[str]:
    return [text for key, text in cube.fixed.items() if key in SPLIT]


def _beside_each_other(
    own: Iterable[int], cubes: Sequence[Cube], axes: Mapping[str, Axis], title: str, name: str
) -> list[Sheet]:
    """Return tables of several variables, a row per value of one of their axes."""
    own = list(own)
    keys = list(dict.fromkeys(dim for number in own for dim in cubes[number].dims))
    # First the axis that most variables have, and the longest of those.
    keys.sort(key=lambda dim: (-sum(dim in cubes[k].dims for k in own), -len(axes[dim].texts)))
    columns = [
        told(cubes[number]) + (f" [{cubes[number].units}]" if cubes[number].units else "")
        for number in own
    ]
    sheets = []
    beside = f"; see {OTHERS[name]}" if name in OTHERS else ""
    for dim in keys or [""]:
        places = sorted({place for k in own for place in _places(cubes[k], dim)}) if dim else [0]
        lines = [
            Line(
                axes[dim].texts[place] if dim else "all",
                [Cell(number, {dim: place} if dim else {}) for number in own],
            )
            for place in places
        ]
        heading = axes[dim].label if dim else ""
        by = f" by {axes[dim].words}" if dim else ""
        sheets.append(
            Sheet(
                *(f"{title}{by}{beside}", heading, columns, lines[:MOST], dim, name),
                *(dim == (keys or [""])[0], max(0, len(lines) - MOST), True),
            )
        )
    return sheets


def _places(cube: Cube, dim: str) -> tuple[int, ...]:
    return cube.at[cube.dims.index(dim)] if dim in cube.dims else ()
