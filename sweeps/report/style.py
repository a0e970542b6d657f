"""Colours, sizes and layout that all pictures share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

# Distinct in normal vision, in the three kinds of colour blindness, and by lightness in print.
BLUE, RUST, GREEN, GOLD = "#1f4e79", "#c1440e", "#009e73", "#e0a11b"
ORCHID, SKY, BROWN, BLACK = "#c79bd6", "#8ab8e6", "#5a3a22", "#000000"
LINE_COLOURS = (BLUE, RUST, GREEN, GOLD, ORCHID, BLACK)
OURS, THEIRS = BLUE, RUST
SHIP_COLOURS = (BLUE, RUST, GREEN, GOLD, SKY, BROWN)

# Fonts [points], of figures some 10 inches wide.
TITLE, HEADING, LABEL, SMALL = 12.0, 10.5, 9.5, 8.5

OFFSET = 0.02  # largest shift of a mark along x, relative, so that intervals do not coincide
OFFSET_NOTE = f"Marks are offset by up to {100 * OFFSET:g} % along x so that coinciding ones show."
HALO = [withStroke(linewidth=2.5, foreground="white")]  # of text over lines
BELOW: dict[str, Any] = {"loc": "outside lower center", "frameon": False}


def titled(figure: Figure, title: str, *conditions: str) -> None:
    """Write a title, and on the next line the conditions that hold in all panels."""
    said = ", ".join(one for one in conditions if one)
    figure.suptitle(f"{title}\n{said}" if said else title, fontsize=TITLE)


def aspect_title(label: str) -> str:
    """Return the title of a panel of an aspect bin."""
    return label if label == "overall" else f"aspect {label.replace('-', '–')}°"


def bare(axes: Axes) -> None:
    """Draw axes without a frame at the right and the top."""
    axes.spines[["right", "top"]].set_visible(False)


def plain_percent(axes: Axes) -> None:
    """Draw horizontal grid lines of a percentage, and no frame at the right and the top."""
    axes.set(ylim=(0.0, 104.0))
    axes.grid(axis="y", color="0.92")
    axes.set_axisbelow(True)
    bare(axes)


def offset(values: Iterable[float], place: int, count: int) -> list[float]:
    """Return positions on a logarithmic axis of one of several lines, each with its own offset."""
    share = 0.0 if count == 1 else 2 * place / (count - 1) - 1
    return [value * (1 + OFFSET * share) for value in values]


def nested(place: int, count: int) -> dict[str, float]:
    """Return widths of one of several lines: each is thinner than those below it.

    A line and its marks then show even if a later one has the same values.
    """
    back = 1.0 if count == 1 else 1 - place / (count - 1)
    return {"lw": 1.1 + 1.5 * back, "ms": 4.0 + 3.0 * back, "elinewidth": 0.8, "capsize": 2.0}


def key_below(figure: Figure, axes: Axes, **how: Any) -> None:
    """Draw the legend of a panel below all of them."""
    handles, labels = axes.get_legend_handles_labels()
    columns = {"ncols": min(len(labels), 3), "fontsize": SMALL, "title_fontsize": SMALL}
    figure.legend(handles, labels, **(BELOW | columns | how))
