"""The text at the end of a sweep: what it found, its main table, paths, and next commands."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.cells import cell_len
from rich.console import Console

from sweeps.engine.kinds import Count, Number
from sweeps.engine.settings import Choices, Setting
from sweeps.report.files import write_tables
from sweeps.report.frames import Frame, read_frames
from sweeps.report.headline import headline, main_axis
from sweeps.report.own import is_free
from sweeps.report.pivot import at_main, laid_out, place_of
from sweeps.report.places import page_file, tables_folder
from sweeps.report.stores import attributes, failed_cells, opened
from sweeps.report.terminal import line, note, page, print_table
from sweeps.report.words import printable, shown
from sweeps.report.work import read_work
from sweeps.stages.views import Grid

VARIED = (Grid.pulse_width, Grid.frame_count, Grid.vigilance, Grid.range, Grid.aspect)
"""Settings to which the example of a next command may add a value."""
LABEL = " " * len("store   ")
LONGEST_LIST = 8  # values of a list in that example
MOST_LINES = 14  # of the main table


def tables_of(path: Path) -> dict[str, Frame]:
    """Return all tables of a store, the work of its last sweep included."""
    frames, work = read_frames(path), read_work(path)
    return frames | ({work.name: work} if work is not None else {})


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
    frames = tables_of(path)
    kept, failure = write_tables(path, frames.values())
    with page(console) as aside:
        print_main(path, frames, aside)
        print_places(path, frames, aside)
        note(swept(axes), aside)
        for number, words in enumerate(next_commands(path, frames, choices, axes, given)):
            first = f"{'' if number else 'next':<{len(LABEL)}}"
            line(first + continued(words, aside.width), aside)
    if failure:
        raise failure
    return kept


def print_main(path: Path, frames: Mapping[str, Frame], console: Console) -> None:
    """Print what a store says first: its headline, and its main table along the swept axis."""
    about = attributes(opened(path))
    console.print()
    for sentence in headline(frames, about):
        note(sentence, console, style="bold")
    name, main = next(iter(frames.items()))
    axes = about.get("swept", ())
    axis = main_axis(main, axes)
    at = at_main(main, [*main.down, *[axis] * bool(axis)])
    table = laid_out(at, axes, joined=[axis])
    print_table(table, console, most=MOST_LINES, say_rest=False)
    if len(table.lines) > MOST_LINES:
        note(f"{len(table.lines) - MOST_LINES} more rows: --table {name}", console)
    where = place_of(main, at, but=("kind",))
    note(f"At {where}." if where else "", console)


def swept(axes: Mapping[str, int]) -> str:
    """Return a sentence on what was swept: keys of the axes with their numbers of values."""
    listed = ", ".join(f"{key} ({count})" for key, count in axes.items())
    return f"swept   {listed or 'nothing; every setting has one value'}"


def print_places(path: Path, frames: Mapping[str, Frame], console: Console) -> None:
    """Print where a store, its tables and its page are, and how many of its cells failed."""
    line("", console)
    if failed := failed_cells(opened(path)):
        count = f"{len(failed):,} cell" + "s" * (len(failed) > 1)
        line(f"failed  {count}: the tables cover the others", console)
    line(f"store   {located(path)}", console)
    count = f"{len(frames)} CSV file" + "s" * (len(frames) > 1)
    line(f"tables  {located(tables_folder(path))} ({count})", console)
    if page_file(path).is_file() and is_free(page_file(path)):  # else it is not of a report
        line(f"report  {located(page_file(path))}", console)


def located(path: Path) -> str:
    """Return the shortest path from the current folder, with control characters escaped."""
    here = Path.cwd()
    return printable(str(path.relative_to(here) if path.is_relative_to(here) else path))


def next_commands(
    path: Path,
    frames: Mapping[str, Frame],
    choices: Choices,
    axes: Mapping[str, int],
    given: Sequence[str],
) -> list[list[str]]:
    """Return the words of next commands: all tables, one of them, one more value on an axis.

    Words are quoted for a shell.
    """
    store = shlex.quote(located(path))
    found = [["ncti-report", store], ["ncti-report", store, "--table", next(iter(frames))]]
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
    values: list[Any] = [one for one in choices[setting] if isinstance(one, int | float)]
    if not 1 < len(values) < LONGEST_LIST or not isinstance(setting.kind, Number):
        return None
    new = float(f"{(values[-2] + values[-1]) / 2:.6g}")
    if isinstance(setting.kind, Count):
        new = round(new)
    return None if new in values else [*values[:-1], new, values[-1]]
