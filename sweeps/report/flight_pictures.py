"""Pictures of all flights of a store, written beside its tables."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import trimesh
from rich.console import Console
from rich.progress import track

from sweeps import store
from sweeps.flight_comparison import NEAR_STERN, STERN
from sweeps.flight_variables import VALIDATION
from sweeps.report.flight_again import draw_flight, flights_of, known_ship
from sweeps.report.flight_figures import draw_validation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MISSING = "matplotlib is missing: install ncti-sweep[plot]"
TOLD = 6  # names of files; the folder has the others


def write_pictures(
    path: Path, console: Console, *, ship: Callable[[str], trimesh.Trimesh] | None = None
) -> None:
    """Draw every stage of the corrections of each flight, and near-stern profiles.

    Of each ship flown past, range and aspect one flight, the first on any other axis.

    Parameters
    ----------
    path : Path
        The store.
    console : rich.console.Console
        Where to say what was written.
    ship : callable, optional
        The mesh of a label; that of the known ship of this name when not given.

    Raises
    ------
    ImportError
        If there is no matplotlib.
    ValueError
        If the store has no flights, or its ships are no longer known.

    Notes
    -----
    A picture is written under another name and then moved: what can be seen is whole.
    """
    import_module("matplotlib.figure")  # before anything is flown for nothing
    if not store.has_group(path, VALIDATION):
        raise ValueError(f"{str(path)!r} has no flights, but must be the store of a sweep of irar")
    attributes = store.read_attributes(path)
    load = partial(known_ship, attributes) if ship is None else ship
    places = flights_of(attributes)
    folder = store.tables_folder(path)
    folder.mkdir(exist_ok=True)
    meshes = {place.ship: load(place.ship) for place in places}
    drawn: dict[str, Callable[[], Figure]] = {
        f"flight_{place.ship}_{place.range:g}km_{place.aspect:g}deg.png": partial(
            draw_flight, attributes, place, meshes[place.ship]
        )
        for place in places
    }
    if any(abs(place.aspect - STERN) <= NEAR_STERN for place in places):
        drawn["validation.png"] = lambda: draw_validation(store.read_group(path, VALIDATION))
    aside = Console(stderr=True)
    for name, draw in track(drawn.items(), description="  pictures        ", console=aside):
        made = folder / f".{name}.{uuid.uuid4().hex}{store.PARTIAL}"
        try:
            draw().savefig(made, format="png")
            made.replace(folder / name)
        finally:
            made.unlink(missing_ok=True)
    names = list(drawn)
    more = f" and {len(names) - TOLD} more" if len(names) > TOLD else ""
    files = f"{', '.join(names[:TOLD])}{more}"
    console.print(f"pictures  {folder}: {files}", soft_wrap=True, highlight=False)
