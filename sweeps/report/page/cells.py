"""Cells of tables as shown, and the data that the script of the page looks them up in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sweeps.report.axes import NOTHING
from sweeps.report.page.cubes import NAMED, TRUE, Axis, Cube, hole
from sweeps.report.page.layout import Cell

LARGE = 15  # points of difference that are coloured strongly
SMALL = 10_000  # whole numbers below are shown with all digits
LEVELS = 9  # shades of a confusion matrix


@dataclass(frozen=True)
class Shown:
    """A cell: its figure and interval, the source's figure with the difference, CSS classes."""

    text: str
    interval: str = ""
    source: str = ""
    difference: str = ""
    look: str = ""


class Cells:
    """All cells of a page at its initial selection."""

    def __init__(self, cubes: Sequence[Cube], axes: Mapping[str, Axis]) -> None:
        self.cubes, self.axes = cubes, axes
        self._default = {name: axis.default for name, axis in axes.items()}

    def shown(self, cell: Cell) -> Shown:
        """Return the shown form of a cell."""
        cube = self.cubes[cell.cube]
        index = cube.index({**self._default, **cell.at})
        value = None if index is None else cube.values[index]
        if index is None or value is None:
            return Shown(NOTHING)
        text = _said(value, cube)
        low = cube.low[index] if cube.low else None
        high = cube.high[index] if cube.high else None
        interval = ""
        if low is not None and high is not None:
            interval = f"{_said(low, cube)}–{_said(high, cube)}"
        theirs = cube.source[index] if cube.source else None
        if theirs is None or low is None or high is None:
            return Shown(text, interval)
        points = round(value - theirs)
        difference = f"{points:+d}" if points else "±0"
        return Shown(
            text,
            interval,
            str(theirs),
            difference.replace("-", "−"),
            look(points, low, high, theirs),
        )

    def of_matrix(self, line: Sequence[Cell]) -> list[tuple[Cell, str, str, str]]:
        """Return a row of a confusion matrix: cells, percent of the row, count, shade."""
        counts = []
        for cell in line:
            cube = self.cubes[cell.cube]
            index = cube.index({**self._default, **cell.at})
            counts.append(None if index is None else cube.values[index])
        total = sum(count for count in counts if count is not None)
        found = []
        for cell, count in zip(line, counts, strict=True):
            if count is None or not total:
                found.append((cell, NOTHING, "", "k0"))
            else:
                share = count / total
                found.append((cell, f"{100 * share:.0f}", f"{count:.0f}", f"k{shade(share)}"))
        return found

    def elsewhere(self, notes: Sequence[tuple[str, str, str]]) -> list[tuple[str, str, str, bool]]:
        """Return notes on values of other axes, each with whether that value is not selected."""
        return [
            (dim, words, text, text != self.axes[dim].told(self.axes[dim].default))
            for dim, words, text in notes
        ]

    def place(self, cell: Cell) -> str:
        """Return the place of a cell on axes other than the selected ones, for the script."""
        return ";".join(f"{name}:{place}" for name, place in cell.at.items())

    def code(self, cell: Cell) -> str:
        """Return the Python code that reads the figure of a cell."""
        cube = self.cubes[cell.cube]
        place = {**self._default, **cell.at}
        index = cube.index(place)
        if index is None:
            return ""
        found = cube.code
        for dim, there in zip(cube.dims, cube.at, strict=True):
            here = place[dim]
            known = cube.codes[dim][there.index(here)] if dim in cube.codes else None
            found = found.replace(
                hole(dim), known if known is not None else self.axes[dim].codes[here]
            )
        return found

    def data(self) -> dict[str, Any]:
        """Return axes and cubes for the script."""
        axes = {
            name: {
                "t": [axis.told(k) for k in range(len(axis.texts))],
                "c": axis.codes,
                "d": axis.default,
            }
            for name, axis in self.axes.items()
        }
        cubes = [
            {
                "g": cube.group.rpartition("/")[2],
                "d": cube.dims,
                "a": cube.at,
                "v": cube.values,
                "l": cube.low,
                "h": cube.high,
                "n": cube.count,
                "s": cube.source,
                "p": cube.units == "%",
                "i": cube.counted,
                "k": cube.code,
                "o": cube.codes,
            }
            for cube in self.cubes
        ]
        return {"axes": axes, "cubes": cubes, "named": NAMED, "true": TRUE}


def _said(value: float, cube: Cube) -> str:
    """Return a number of a cube: a percentage to a whole one, another to four digits."""
    return f"{value:.0f}" if cube.units == "%" else number(value, counted=cube.counted)


def number(value: float, *, counted: bool = False) -> str:
    """Return a number to four digits; whole ones as they are if small or `counted`.

    The script of the page has the same rule, where 2.0 and 2 are the same number.
    """
    if float(value).is_integer() and (counted or abs(value) < SMALL):
        return str(int(value))
    return f"{value:.4g}"


def look(points: int, low: float, high: float, theirs: float) -> str:
    """Return the class of a difference: none within the interval, else by sign and size."""
    if low <= theirs <= high:
        return "same"
    strong = " strong" if abs(points) >= LARGE else ""
    return f"{'above' if points > 0 else 'below'}{strong}"


def shade(share: float) -> int:
    """Return the shade of a share of a row, 0 to 9."""
    return min(LEVELS, int(share * LEVELS + 0.999))
