"""The text at the end of a sweep: swept axes, one table, paths of the results, next commands."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.cells import cell_len
from rich.console import Console

from sweeps.engine.kinds import Count, Number
from sweeps.engine.settings import Choices, Setting
from sweeps.report.axes import printable, shown
from sweeps.report.headline import headline
from sweeps.report.parts import Part, located, parts_of, print_places, write_parts
from sweeps.report.screen import line, note, page
from sweeps.stages.views import Grid

VARIED = (Grid.pulse_width, Grid.frame_count, Grid.vigilance, Grid.range, Grid.aspect)
"""Settings to which the example of a next command may add a value."""
LABEL = " " * len("store   ")
LONGEST_LIST = 8  # values of a list in that example


def summarize(
    path: Path,
    choices: Choices,
    axes: Mapping[str, int],
    console: Console,
    *,
    given: Sequence[str] = (),
) -> list[Path]:
    """Write the tables of a finished store beside it, and print a summary.

    `axes` are the numbers of values of what was swept, by key, and `given` the arguments of the
    command. Returns the paths at which other files are in the way of tables. Raises
    ConfigurationError if the store has no tables, and OSError if tables cannot be written; the
    summary is printed anyway.
    """
    parts = parts_of(path)
    kept, failure = write_parts(path, parts)
    with page(console) as aside:
        note(f"\n{swept(axes)}", aside)
        headline(parts, aside)
        print_places(path, parts, aside)
        for number, words in enumerate(next_commands(path, parts, choices, axes, given)):
            first = f"{'' if number else 'next':<{len(LABEL)}}"
            line(first + continued(words, aside.width), aside)
    if failure:
        raise failure
    return kept


def swept(axes: Mapping[str, int]) -> str:
    """Return a sentence on what was swept: keys of the axes with their numbers of values."""
    listed = ", ".join(f"{key} ({count})" for key, count in axes.items())
    return (
        f"Swept (numbers of values): {listed}."
        if listed
        else "Swept: nothing; every setting has one value."
    )


def next_commands(
    path: Path,
    parts: Sequence[Part],
    choices: Choices,
    axes: Mapping[str, int],
    given: Sequence[str],
) -> list[list[str]]:
    """Return the words of next commands: all tables, one of them, one more value on an axis.

    Words are quoted for a shell.
    """
    store = shlex.quote(located(path))
    longest = max(parts, key=lambda part: (part.listed, len(part.rows))).name
    found = [["ncti-report", store], ["ncti-report", store, "--table", longest]]
    if any(one.startswith("-") for one in given) or not given:
        return found  # a multirun, or not started from a command line
    for setting in VARIED:
        values = extended(setting, choices) if setting.key in axes else None
        if values:
            kept = [
                one
                for one in given
                if one.lstrip("+~").partition("=")[0] not in (setting.key, "store")
            ]
            listed = ",".join(map(shown, values))
            words = ["ncti-sweep", *kept, f"{setting.key}=[{listed}]", f"store={located(path)}"]
            return [*found, [shlex.quote(printable(word)) for word in words]]
    return found


def continued(words: Sequence[str], width: int) -> str:
    """Return a command in lines of some width, continued by backslashes."""
    lines = [words[0]]
    for word in words[1:]:
        if cell_len(f"{LABEL}{lines[-1]} {word} \\") > width:
            lines.append(f"  {word}")
        else:
            lines[-1] += f" {word}"
    return f" \\\n{LABEL}".join(lines)


def extended(setting: Setting, choices: Choices) -> list[float] | None:
    """Return the values of a setting and one between the last two; None if the list is long."""
    values = [one for one in choices[setting] if isinstance(one, int | float)]
    if not 1 < len(values) < LONGEST_LIST or not isinstance(setting.kind, Number):
        return None
    new = float(f"{(values[-2] + values[-1]) / 2:.6g}")
    if isinstance(setting.kind, Count):
        new = round(new)
    return None if new in values else [*values[:-1], new, values[-1]]
