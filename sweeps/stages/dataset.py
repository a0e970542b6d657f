"""Data sets of simulated rows: `ncti.dataset` in pieces, each a cell that is kept.

Rows draw ships, ranges, pulse widths and numbers of frames uniformly from the grid. A piece holds
the rows that `ncti.dataset` returns for the same seed and numbers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ncti.data import dataset
from ncti.data.rows import RADAR_COORDINATES, ROWS, VARIABLES
from ncti.data.views import SENSOR_SETS
from ncti.infrared import SUPER_RESOLUTIONS
from ncti.infrared.loops import IMAGES
from ncti.ladar.loops import FRAMES
from ncti.machine_code import CompiledLoops
from ncti.render.loops import LINES, engine_loops
from sweeps.engine.declare.display import Display, Figure
from sweeps.engine.declare.settings import (
    Choices,
    Run,
    Settings,
    count,
    draws,
    set_of,
    vector,
    word,
)
from sweeps.engine.declare.stage import Condition, Group, Output
from sweeps.stages import views
from sweeps.stages.infrared import Infrared, map_cells
from sweeps.stages.ladar import Ladar, check_profiles, profile_bins
from sweeps.stages.meshes import MeshSource, read_mesh
from sweeps.stages.refusals import require
from sweeps.stages.views import Arrays, Grid, Render, Scene, quantity, uses_sensor

if TYPE_CHECKING:
    import trimesh
    import xarray as xr

SENSOR = "dataset"


class Rows(Settings, key="dataset"):
    """Rows of a data set and the ranges of their parameters."""

    sensor = word(
        "range", tuple(SENSOR_SETS), label="sensors of the data set", not_swept="it shapes arrays"
    )
    pieces = draws(1, 10**6, label="pieces of rows, by number", dimension="piece", role="dimension")
    rows = count(1000, 1, 10**6, label="rows of a piece", not_swept=views.SHAPES)
    rows_per_view = count(25, 1, 10**6, label="rows of a view")
    aspect = vector([0, 360], 2, -360, 360, label="ends of the aspects drawn", unit="degree")
    cnr = set_of(
        quantity(
            *(
                None,
                -100,
                100,
                "dB",
                "carrier-to-noise ratios of a filled IFOV that are drawn from",
            ),
            help="null: 32 dB at 100 km, and by the square of the range elsewhere",
        )
    )
    gain = vector([1, 1], 2, 0, 1000, label="ends of the gains drawn")
    floor = vector(
        [0, 0],
        size=2,
        low=-1000,
        high=1000,
        label="ends of the shifts of the noise floor drawn, in rms deviations of a frame",
    )
    super_resolution = word(
        "none",
        SUPER_RESOLUTIONS,
        label="super-resolution method of silhouettes",
        dimension="super_resolution",
        not_swept="a data set has one",
    )


def _has_rows_of(kind: str) -> Condition:
    """Return the condition that the data set has rows of a sensor."""
    return lambda choices: (
        uses_sensor(SENSOR)(choices) and kind in SENSOR_SETS[choices.value(Rows.sensor)]
    )


# Each group has the parameters of its rows, so that either can be read alone.
ROW_SETTINGS = (Rows, Grid, Scene, Ladar, Render, Run)
PROFILES = Group(SENSOR, _has_rows_of("range"), ROW_SETTINGS)
SILHOUETTES = Group(f"{SENSOR}_infrared", _has_rows_of("infrared"), (*ROW_SETTINGS, Infrared))

# Keywords of `ncti.dataset`: settings; those of the grid are lists to draw from.
COMMON_INPUTS = {
    "seed": Run.seed,
    "piece": Rows.pieces,
    "count": Rows.rows,
    "rows_per_view": Rows.rows_per_view,
    "aspect": Rows.aspect,
    "depression": Scene.depression,
    "slant_range": Grid.range,
    "frames": Grid.frame_count,
    "ifov": Ladar.ifov,
    "spacing": Render.pixel,
}
RADAR_INPUTS = COMMON_INPUTS | {
    "pulse_width": Grid.pulse_width,
    "cnr": Rows.cnr,
    "gain": Rows.gain,
    "floor": Rows.floor,
    "bin_width": Ladar.bin_width,
    "window": Ladar.window,
    "target_free_ifovs": Ladar.target_free_ifovs,
}
IMAGER_INPUTS = COMMON_INPUTS | {"imager": "imager", "super_resolution": Rows.super_resolution}
LIST_INPUTS = ("slant_range", "frames", "pulse_width", "cnr")
INTEGERS = {"row": "i8", "view": "i8", "frames": "i4", "ship": "i4"}


def _declare_parameters(names: Iterable[str]) -> list[Output]:
    """Declare parameters of rows, such as `row_aspect`."""
    outputs = [Output("rows", ("ship",), "i4", label="rows of a ship")]
    for name in names:
        description = ROWS[name]
        unit, label = ("1", description) if isinstance(description, str) else description
        label += ", as an index into the ship axis" if name == "ship" else ""
        dtype = INTEGERS.get(name, "f8")
        outputs.append(Output(f"row_{name}", ("place",), dtype, label=label, unit=unit))
    return outputs


def make_rows(
    mesh_sources: tuple[MeshSource, ...],
    ship: tuple[str, ...],
    piece: int,
    count: int,
    sensor: str,
    **inputs: Any,
) -> Arrays:
    """Return the arrays of the rows of a piece, as `ncti.dataset` makes them."""
    drawn = {name: list(inputs[name]) for name in LIST_INPUTS if inputs.get(name) is not None}
    meshes = [named_mesh(*pair) for pair in zip(mesh_sources, map(str, ship), strict=True)]
    rows = dataset(meshes, count, first=piece * count, sensor=sensor, **{**inputs, **drawn})
    index = np.searchsorted(np.array(ship, dtype=str), rows.ship.values)
    arrays = {f"row_{name}": values.values for name, values in rows.coords.items() if name in ROWS}
    arrays |= {"row_ship": index, "rows": np.bincount(index, minlength=len(ship))}
    return arrays | {str(name): values.values for name, values in rows.data_vars.items()}


@PROFILES.stage(
    *_declare_parameters(ROWS),
    Output("profile", ("place", "down_range"), label=VARIABLES["profile"][1]),
    reads=RADAR_INPUTS,
    gather=(Grid.ship, Grid.range, Grid.frame_count, Grid.pulse_width),
)
def profile_rows(
    mesh_sources: tuple[MeshSource, ...], ship: tuple[str, ...], **inputs: Any
) -> Arrays:
    """Return a piece of rows of the laser radar."""
    return make_rows(mesh_sources, ship, sensor="range", **inputs)


@SILHOUETTES.stage(
    *_declare_parameters(name for name in ROWS if name not in RADAR_COORDINATES),
    Output("silhouette", ("place", "angle", "radius"), "u1", VARIABLES["silhouette"][1]),
    reads=IMAGER_INPUTS,
    gather=(Grid.ship, Grid.range, Grid.frame_count),
)
def silhouette_rows(
    mesh_sources: tuple[MeshSource, ...], ship: tuple[str, ...], **inputs: Any
) -> Arrays:
    """Return a piece of rows of the imager."""
    return make_rows(mesh_sources, ship, sensor="infrared", **inputs)


def named_mesh(mesh_source: MeshSource, label: str) -> trimesh.Trimesh:
    """Return a ship's mesh with the sweep's label as its name."""
    mesh = read_mesh(mesh_source)
    if mesh.metadata.get("name") != label:
        mesh = mesh.copy()
        mesh.metadata["name"] = label
    return mesh


row_bins = replace(profile_bins, name="row_bins", group=PROFILES)
row_cells = replace(map_cells, name="row_cells", group=SILHOUETTES)


def check(choices: Choices) -> None:
    """Refuse (`ConfigurationError`) scenes, ships and ranges that rows do not support."""
    if uses_sensor(SENSOR)(choices):
        check_profiles(choices)
        require(choices, Scene.geometry, "fixed", f"with the sensor {SENSOR}")
        require(choices, Render.tolerance, None, f"with the sensor {SENSOR}")
        views.check_ranges(choices, Grid.range, Ladar.ifov)


def tabulate(made_rows: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the number of rows of each ship."""
    rows = made_rows.rows.where(made_rows.rows >= 0).sum("piece", keep_attrs=True)
    return rows.to_dataset().assign_attrs(title="Rows of each ship")


def loops(choices: Choices) -> list[CompiledLoops]:
    """Return the loops that rows of both sensors take."""
    return [FRAMES, engine_loops(LINES), IMAGES] if uses_sensor(SENSOR)(choices) else []


STAGES = (
    profile_rows,
    silhouette_rows,
    row_bins,
    row_cells,
)
TABLES = tuple(
    group.table(
        group.path,
        tabulate,
        Display(group.path, title, (Figure("rows", format=".0f"),), rows=("ship",)),
    )
    for group, title in ((PROFILES, "Rows of profiles"), (SILHOUETTES, "Rows of silhouettes"))
)
