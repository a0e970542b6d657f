"""Pictures of a store beside its tables: every stage of the corrections of flights."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import track

from sweeps.report import rows
from sweeps.report.axes import printable
from sweeps.report.own import OwnFiles
from sweeps.report.places import tables_folder
from sweeps.report.screen import line, page

if TYPE_CHECKING:
    import trimesh
    from matplotlib.figure import Figure

TOLD = 6  # names of pictures that are printed


def write_pictures(
    path: Path, console: Console, *, ship: Callable[[str], trimesh.Trimesh] | None = None
) -> list[Path]:
    """Draw every stage of the corrections of each flight, and near-stern profiles.

    One flight for each ship, range and aspect, nominal on any other axis. `ship` returns
    the mesh of a label, instead of the known ship of that name. Returns the paths at which other
    files are in the way. Raises ValueError if the store has no flights, or its ships are unknown.
    """
    # Imported here, since only flights need it and it is slow to import.
    from sweeps.report.flight_figures import draw_flight, draw_validation, flights_of, known_ship

    store = rows.opened(path)
    if "validation" not in store:
        raise ValueError(f"{str(path)!r} has no flights, but must be the store of a sweep of irar")
    given, folder = rows.attributes(store), tables_folder(path)
    flights = rows.read(store, "validation")
    files = OwnFiles(folder)
    load, places = ship or partial(known_ship, given), flights_of(flights)
    meshes = {place.ship: load(place.ship) for place in places}
    drawn: dict[str, Callable[[], Figure]] = {}
    for place in places:
        label = re.sub(r"[^\w.-]", "_", place.ship)
        name = f"flight_{label}_{place.range:g}km_{place.aspect:g}deg.png"
        drawn[name] = partial(draw_flight, given, flights, place, meshes[place.ship])
    if flights.stern_to_hangar.notnull().any():
        drawn["validation.png"] = partial(draw_validation, flights)
    aside = Console(stderr=True)
    for name, make in track(drawn.items(), description="  pictures        ", console=aside):
        content = io.BytesIO()
        make().savefig(content, format="png")
        files.put(name, content.getvalue())
    names = list(drawn)
    more = f" and {len(names) - TOLD} more" if len(names) > TOLD else ""
    with page(console) as there:
        line(f"pictures  {printable(str(folder))}: {', '.join(names[:TOLD])}{more}", there)
    return files.kept
