"""Charts of the page: curves as SVG paths, which its script redraws for another selection."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from sweeps.report.page.cubes import BIN, OVERALL, Axis, Cube, Place

WIDTH, HEIGHT = 340, 226
LEFT, RIGHT, TOP, BOTTOM = 42, 12, 20, 40  # margins
LETTERS = 11  # of a label
SHAPES = ("circle", "square", "diamond", "triangle")
COLOURS = 8


@dataclass(frozen=True)
class Series:
    """A curve: its cube, its style, and its paths at the initial selection."""

    cube: int
    label: str
    colour: int
    shape: int
    line: str
    bars: str
    marks: str


@dataclass(frozen=True)
class Scale:
    """Scale of values from low to high, over some pixels upwards."""

    low: float
    high: float
    logarithmic: bool

    def at(self, value: float) -> float:
        """Return the height of a value on the chart, within its frame."""
        low, high, here = self.low, self.high, value
        if self.logarithmic:
            low, high = math.log10(low), math.log10(high)
            here = math.log10(value) if value > 0 else low
        share = min(1.0, max(0.0, (here - low) / (high - low)))
        return HEIGHT - BOTTOM - share * (HEIGHT - BOTTOM - TOP)

    @property
    def ticks(self) -> list[tuple[str, float]]:
        """Return labels of values, with their heights."""
        if self.logarithmic:
            first, last = math.ceil(math.log10(self.low)), math.floor(math.log10(self.high))
            every = max(1, (last - first) // 4)
            values = [10.0**power for power in range(first, last + 1, every)]
        else:
            step = _step(self.high - self.low)
            first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
            values = [step * number for number in range(first, last + 1)]
        return [(f"{value:.4g}", self.at(value)) for value in values]


@dataclass(frozen=True)
class Chart:
    """Curves against an axis: positions of its values by place, None for absent ones."""

    title: str
    axis: Axis
    unit: str
    series: list[Series]
    across: list[float | None]
    labels: list[tuple[str, str, float]]
    scale: Scale
    joined: bool
    keyed: bool = False

    @property
    def empty(self) -> bool:
        """Return whether there is no value at the selection."""
        return not any(one.marks for one in self.series)


def chart(
    texts: tuple[str, str, Sequence[str]],
    axis: Axis,
    numbers: Sequence[int],
    looks: Sequence[int],
    cubes: Sequence[Cube],
    axes: Mapping[str, Axis],
    ends: tuple[float, float] | None = None,
) -> Chart:
    """Return the chart of some cubes against an axis, at the default values of the others.

    `texts` are its title, its unit and the names of its curves, `ends` are those of its scale.
    """
    title, unit, names = texts
    places = sorted({place for k in numbers for place in _along(cubes[k], axis.name)})
    if axis.name == BIN:
        places = [place for place in places if axis.texts[place] != OVERALL] or places
    across = dict(zip(places, positions(axis, places), strict=True))
    scale = Scale(*ends, False) if ends else _scale(cubes[k] for k in numbers)
    default = {name: one.default for name, one in axes.items()}
    series = []
    for number, look, name in zip(numbers, looks, names, strict=True):
        paths = drawn(cubes[number], axis.name, default, across, scale, shape_of(look))
        series.append(Series(number, name, look % COLOURS, shape_of(look), *paths))
    labels = _labels([(axis.texts[place], x) for place, x in across.items()])
    every = [across.get(place) for place in range(len(axis.texts))]
    joined = axis.numbers is not None or axis.name == BIN
    return Chart(
        *(f"{title} against {axis.words}", axis, unit, series, every, labels, scale, joined),
        keyed=ends is None and len(series) > 1,
    )


def shape_of(look: int) -> int:
    """Return the shape of a curve's marks, unique in combination with its colour."""
    return (look + look // COLOURS) % len(SHAPES)


def _along(cube: Cube, dim: str) -> tuple[int, ...]:
    return cube.at[cube.dims.index(dim)]


def positions(axis: Axis, places: Sequence[int]) -> list[float]:
    """Return positions of values on an axis: linear, or logarithmic if that spreads them more."""
    left, right = LEFT + 14, WIDTH - RIGHT - 14
    count = len(places)
    values: list[float] = list(range(count))
    if axis.numbers is not None and count > 1:
        values = [axis.numbers[place] for place in places]
        if min(values) > 0 and max(values) > 4 * min(values):
            logs = [math.log10(value) for value in values]
            values = max((values, logs), key=_least_gap)
    span = values[-1] - values[0] if count > 1 else 1.0
    if span <= 0:
        return [(left + right) / 2] * count
    return [round(left + (right - left) * (value - values[0]) / span, 1) for value in values]


def _least_gap(values: Sequence[float]) -> float:
    gaps = [after - before for before, after in pairwise(values)]
    return min(gaps) / (values[-1] - values[0])


def _labels(there: Sequence[tuple[str, float]]) -> list[tuple[str, str, float]]:
    """Return labels that do not overlap, short and in full, with positions; both ends first."""
    kept: list[tuple[str, float]] = []
    for text, x in (*there[:1], *there[-1:], *there[1:-1]):
        wide = 6.2 * min(len(text), LETTERS) + 6
        if all(abs(x - other) >= max(wide, 24) for _, other in kept):
            kept.append((text, x))
    return [
        (text if len(text) <= LETTERS else f"{text[: LETTERS - 1]}…", text, x) for text, x in kept
    ]


def _scale(cubes: Iterable[Cube]) -> Scale:
    values = [
        value
        for cube in cubes
        for value in (*cube.values, *cube.low, *cube.high)
        if value is not None
    ]
    low, high = min(values, default=0.0), max(values, default=1.0)
    if 0 < 300 * low < high:
        return Scale(10 ** math.floor(math.log10(low)), 10 ** math.ceil(math.log10(high)), True)
    if low == high:
        high = low + (abs(low) or 1.0)
    if 0 < low < high / 2:
        low = 0.0
    step = _step(high - low)
    return Scale(step * math.floor(low / step), step * math.ceil(high / step), False)


def _step(span: float) -> float:
    """Return the step of about four labels."""
    power = 10 ** math.floor(math.log10(span / 4))
    return float(next(k * power for k in (1, 2, 2.5, 5, 10) if k * power >= span / 4 * 0.999))


def drawn(
    cube: Cube,
    axis: str,
    place: Place,
    across: Mapping[int, float],
    scale: Scale,
    shape: int,
) -> tuple[str, str, str]:
    """Return paths of a cube against an axis: its line, the bars of its intervals, its marks."""
    points, bars, marks = [], [], []
    for here, x in across.items():
        index = cube.index({**place, axis: here})
        value = None if index is None else cube.values[index]
        if index is None or value is None:
            continue
        y = scale.at(value)
        points.append(f"{x:.1f} {y:.1f}")
        marks.append(_mark(shape, x, y))
        if cube.low and cube.low[index] is not None and cube.high[index] is not None:
            ends = (scale.at(end) for end in (cube.low[index], cube.high[index]) if end is not None)
            low, high = ends
            bars.append(f"M{x:.1f} {low:.1f}V{high:.1f}")
    return "M" + "L".join(points) if points else "", "".join(bars), "".join(marks)


def _mark(shape: int, x: float, y: float) -> str:
    match SHAPES[shape]:
        case "circle":
            return f"M{x - 3:.1f} {y:.1f}a3 3 0 1 0 6 0a3 3 0 1 0 -6 0z"
        case "square":
            return f"M{x - 3:.1f} {y - 3:.1f}h6v6h-6z"
        case "diamond":
            return f"M{x:.1f} {y - 4:.1f}l4 4l-4 4l-4 -4z"
        case _:
            return f"M{x:.1f} {y - 4:.1f}l4 7h-8z"
