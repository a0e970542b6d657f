"""The group `ships` of a store: measures and a picture of each ship, and warnings.

With them a report can show the ships of a sweep without their mesh files.
"""

from __future__ import annotations

import os
import re
import shlex
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.render import cast_rays
from ncti.render.view import View
from ncti.text import printable
from sweeps.engine.declare.settings import Choices
from sweeps.engine.declare.stage import Group, Output, stage
from sweeps.stages.meshes import description, mesh_source
from sweeps.stages.ships import ShipName, ship_name
from sweeps.stages.views import Grid

if TYPE_CHECKING:
    import trimesh

    from ncti.ships import Transform

GROUP = "ships"
MEASURES = ("length", "beam", "height")
ASPECT, DEPRESSION = 57.0, 12.0  # of the picture [deg]: from the port bow, which is on the left
ROWS, COLUMNS = 80, 200  # of the picture
LIGHT = np.array([0.4, 0.6, 0.69])  # towards the light: right, up, towards the eye
AMBIENT, KEYLIGHT = 0.3, 0.7
LEVELS = 255  # of the picture's brightness
MAX_WARNING = 300  # characters
MAX_LINES = 12  # of ships, on the screen


@stage(
    *(Output(name, dtype="f8", label=f"{name} above the waterline", unit="m") for name in MEASURES),
    Output("facets", dtype="i4", label="facets of the mesh"),
    Output("pixel", dtype="f8", label="pixel of the picture", unit="m"),
    Output(
        "picture",
        ("row", "column"),
        label=f"brightness from 0 to 1 at aspect {ASPECT:g} deg, depression {DEPRESSION:g} deg, "
        "the lowest row first; NaN: background",
    ),
    Output(
        "warning",
        dtype=f"U{MAX_WARNING}",
        label="what looks wrong with the axes or origin of the mesh; empty: nothing",
    ),
    group=Group(GROUP),
)
def portrait(mesh: trimesh.Trimesh) -> dict[str, Any]:
    """Return a ship's measures, its picture, and a warning about its mesh."""
    measures = dict(zip(MEASURES, mesh.extents, strict=True))
    words = warning(mesh.metadata["findings"], mesh.metadata["suggested_transform"])
    counted = {"facets": len(mesh.faces), "warning": words[:MAX_WARNING]}
    return measures | counted | dict(zip(("pixel", "picture"), draw_portrait(mesh), strict=True))


def draw_portrait(mesh: trimesh.Trimesh) -> tuple[float, NDArray[np.float32]]:
    """Return the pixel [m] and the brightness, (row, column), of a ship that fills the picture.

    Row 0 is the lowest. Cast a ray through each pixel centre and shade the nearest facet as a
    diffuse surface, lit from above right of the viewer; NaN where the ray hits none.
    """
    right, up, away = View(ASPECT, DEPRESSION, roll=0.0).axes
    corners = np.asarray(mesh.vertices)
    across, high, depth = corners @ right, corners @ up, corners @ away
    pixel = float(max(np.ptp(across) / (COLUMNS - 2), np.ptp(high) / (ROWS - 2)))
    column = (np.arange(COLUMNS) - (COLUMNS - 1) / 2) * pixel + (across.min() + across.max()) / 2
    row = (np.arange(ROWS) - (ROWS - 1) / 2) * pixel + (high.min() + high.max()) / 2
    origin = row[:, None, None] * up + column[:, None] * right + (depth.min() - 10.0) * away
    origin = origin.reshape(-1, 3)
    hits = cast_rays(mesh, origin, np.broadcast_to(away, origin.shape))
    normal = np.asarray(mesh.face_normals)[hits.facet] @ np.array([right, up, -away]).T
    lit = np.maximum(normal @ (LIGHT / np.linalg.norm(LIGHT)), 0.0)
    picture = np.full(ROWS * COLUMNS, np.nan, dtype=np.float32)
    picture[hits.ray] = np.round((AMBIENT + KEYLIGHT * lit) * LEVELS) / LEVELS
    return pixel, picture.reshape(ROWS, COLUMNS)


def warning(
    findings: tuple[str, ...], suggested: Transform | None, ship: ShipName | None = None
) -> str:
    """Return a warning about a ship and its remedy; empty if there is no fault.

    With a ship, the remedy is an argument of the command, quoted for a shell.
    """
    if suggested is None:
        return ""
    words = " and ".join(filter(None, (", ".join(findings[:-1]), findings[-1])))
    entries = [str(suggested)] if str(suggested) else []
    if ship is None:
        return f"{words}; if so, use {f'{{{entries[0]}}}' if entries else 'no transform'}"
    known = ship_name(ship.source)
    label_entry = [f"name: {_quote_for_hydra(ship)}"] if ship != known else []
    source = ship.source if known == ship.source else os.path.relpath(ship.source)
    mapping = ", ".join((f"path: {_quote_for_hydra(source)}", *label_entry, *entries))
    return f"{words}; if so, use {shlex.quote(f'{Grid.ship.key}={{{mapping}}}')}"


def _quote_for_hydra(word: str) -> str:
    """Quote a string for a mapping in a Hydra override."""
    if re.fullmatch(r"[\w./-]+", word, re.ASCII):
        return str(word)
    escaped = word.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def about(choices: Choices) -> list[str]:
    """Return a line for each of the first ships of a sweep, and a line for each warning."""
    ships = [(ship, description(mesh_source(ship))) for ship in choices[Grid.ship]]
    width = max(len(ship) for ship, _ in ships[:MAX_LINES])
    lines = [f"{ship:<{width}}  {details.measures}" for ship, details in ships[:MAX_LINES]]
    if lengths := [details.length for _, details in ships[MAX_LINES:]]:
        lines.append(
            f"and {len(lengths)} more ships, {min(lengths):.1f} to {max(lengths):.1f} m long"
        )
    lines += [
        f"{ship} had {fault}, which {'are' if len(details.faults) > 1 else 'is'} corrected"
        for ship, details in ships
        if (fault := " and ".join(details.faults))
    ]
    lines += [
        f"warning: {ship} {warning(details.findings, details.suggested_transform, ship)}"
        for ship, details in ships
        if details.findings
    ]
    return [printable(line) for line in lines]


STAGES = (portrait,)
