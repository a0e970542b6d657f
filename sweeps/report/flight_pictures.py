"""Pictures of all flights of a store, written beside its tables."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import trimesh
from rich.console import Console
from rich.progress import track

from sweeps.report import stored
from sweeps.report.axes import printable
from sweeps.report.flight_again import draw_flight, flights_of, known_ship
from sweeps.report.flight_figures import draw_validation
from sweeps.report.output import page, write_whole
from sweeps.report.screen import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MISSING = "matplotlib is missing: install ncti-sweep[plot]"
TOLD = 6  # names of files; the folder has the others


def write_pictures(
    path: Path, console: Console, *, ship: Callable[[str], trimesh.Trimesh] | None = None
) -> None:
    """Draw every stage of the corrections of each flight, and near-stern profiles.

    Of each ship flown past, range and aspect one flight, nominal on any other axis. `ship` gives
    the mesh of a label, in place of the known ship of that name.

    Raises ImportError without matplotlib, and ValueError if the store has no flights, or its ships
    are no longer known.
    """
    import_module("matplotlib.figure")  # before anything is flown for nothing
    if "validation" not in stored.groups(path):
        raise ValueError(f"{str(path)!r} has no flights, but must be the store of a sweep of irar")
    attributes, flights = stored.attributes(path), stored.read(path, "validation")
    load = partial(known_ship, attributes) if ship is None else ship
    places = flights_of(flights)
    folder = stored.tables_folder(path)
    folder.mkdir(exist_ok=True)
    meshes = {place.ship: load(place.ship) for place in places}
    drawn: dict[str, Callable[[], Figure]] = {
        f"flight_{_in_files(place.ship)}_{place.range:g}km_{place.aspect:g}deg.png": partial(
            draw_flight, attributes, flights, place, meshes[place.ship]
        )
        for place in places
    }
    if flights.stern_to_hangar.notnull().any():
        drawn["validation.png"] = lambda: draw_validation(flights)
    aside = Console(stderr=True)
    for name, draw in track(drawn.items(), description="  pictures        ", console=aside):
        figure = draw()
        write_whole(folder / name, partial(figure.savefig, format="png"))
    names = list(drawn)
    more = f" and {len(names) - TOLD} more" if len(names) > TOLD else ""
    files = f"{', '.join(names[:TOLD])}{more}"
    with page(console) as there:
        there.print(plain(f"pictures  {printable(str(folder))}: {files}"), soft_wrap=True)


def _in_files(label: str) -> str:
    """A ship's label as a part of a file's name."""
    return re.sub(r"[^\w.-]", "_", label)
