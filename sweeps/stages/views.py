"""The grid, the scene, and range images of ships, common to all sensors."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import ncti.render
import ncti.ships
from ncti.ladar import lines_within
from ncti.ladar.loops import BOXES
from ncti.machine_code import CompiledLoops
from ncti.render import EngineError, LineImage, RangeImage, Sampling, View
from ncti.render.choice import choose_engine, engines
from ncti.render.far_field import sampling_tolerance
from ncti.render.flight import DEPRESSION, depression_angle
from ncti.render.loops import LINES, engine_loops
from ncti.render.view import ROLL
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.settings import (
    Choices,
    Setting,
    Settings,
    Unit,
    count,
    draws,
    number,
    set_of,
    word,
)
from sweeps.engine.declare.stage import Condition, Stage, Status, derived, in_memory
from sweeps.stages import meshes
from sweeps.stages.meshes import MeshSource
from sweeps.stages.refusals import refuse
from sweeps.stages.ships import ShipFile, ShipName, ships

if TYPE_CHECKING:
    import trimesh

    from ncti.render.mask import Mask

IMPORTS = ("trimesh",)
RANGE, INFRARED, IRAR = "range", "infrared", "irar"
MAX_FRAMES = 10_000
SHAPES = "it shapes arrays"  # why a setting takes one value only

Arrays = dict[str, NDArray[Any]]
Floats = NDArray[np.float64]
Profiles = NDArray[np.float32]


SI = {"km": 1e3, "ns": 1e-9, "urad": 1e-6, "um": 1e-6, "dB km-1": 1e-3}
"""Factors of units to SI; angles of a view stay in degrees."""


def quantity(
    default: Any, low: float, high: float, unit: str, label: str, *, si: bool = True, **about: Any
) -> Setting:
    """Return a setting that is a number with a unit, which stages get in SI; see `Setting`."""
    converted = Unit(unit, SI[unit]) if si and unit in SI else unit
    return number(default, low, high, unit=converted, label=label, **about)


class Sweep(Settings):
    """The sweep."""

    sensor = set_of(  # which other modules declare, as `SENSOR`
        word(RANGE, (), label="sensors", not_swept="it is a set"),
        spellings=(("both", (RANGE, INFRARED)),),
    )


class Grid(Settings, key="grid"):
    """The grid."""

    ship = ships(
        ["duncan", "horne", "spruance", "texas"],
        label="ship",
        help="a known name, a path, or a mapping of the keys below",
        entries=ShipFile.declared,
        role="dimension",
    )
    aspect = number(
        {"start": 0, "stop": 90, "step": 3},
        low=0,
        below=360,
        unit="degree",
        label="aspect, 0 bow-on, 90 port beam",
        role="dimension",
    )
    pulse_width = quantity(30, 1, 1000, "ns", "pulse width, full width at 1/e^2", role="dimension")
    frame_count = count(
        [4, 8, 16, 32],
        1,
        MAX_FRAMES,
        label="frames averaged",
        help="averages share their first frames",
        role="dimension",
    )
    range = quantity(100, 1, 1000, "km", "slant range", role="dimension")
    vigilance = number(0.95, 0, 1, label="vigilance in training", role="dimension")
    replicate = draws(1, label="draw of the noise, by number", role="coordinate")


class Scene(Settings, key="scene"):
    """Position of the aircraft: one depression for every range, or one altitude."""

    geometry = word(
        "fixed",
        ("fixed", "altitude"),
        label="geometry: depression fixed at every range, or altitude",
    )
    depression = quantity(
        *(DEPRESSION, 0, 90, "degree", "depression of the line of sight at the target"),
        help="used where geometry is fixed; equals 22,000 ft at 100 km over a flat sea",
    )
    altitude = quantity(6705.6, 1, 50e3, "m", "altitude of the aircraft", help="22,000 ft")
    earth_radius = quantity(
        6371e3, 1e6, 1e12, "m", "radius of the Earth", help="1e12 for a flat sea"
    )


class Render(Settings, key="render"):
    """Rendering of range images."""

    engine = word(
        "auto",
        ("auto", *engines(), LINES),
        label="rendering engine",
        help="lines: exact along lines a pixel apart; auto: osmesa, else egl, else embree, and "
        "lines where there is a tolerance",
    )
    pixel = quantity(0.25, 0.01, 5, "m", "pixel on the target")
    tolerance = number(
        None,
        low=1e-5,
        high=0.5,
        label="largest relative error of a range extent after the shortest pulse of the grid",
        help="reached by adding lines, starting from one per pixel; null: one line per pixel",
        dimension="render_tolerance",  # the multilayered network has one, too
    )
    samples = count(
        20_000,
        0,
        10**7,
        label="smallest number of samples on the ship; fewer are drawn again with smaller pixels",
    )
    roll = quantity(
        *(ROLL, -180, 180, "degree", "roll of the pixels about the line of sight"),
        help="by default atan of the golden section, so that no ship edge lies along the lattice; "
        "of opposite sign for aspects above 180",
    )
    skip = word(
        "all",
        ("all", "none"),
        label="views that are not rendered",
        help="all: aspects above 180 of a symmetric ship are mirrored from its other side, and "
        "ranges share one far-field view where it errs by at most a tenth of tolerance (1e-4 "
        "where that is null); none: every view is drawn, at its own range",
    )


mesh_source = derived(uses=(Grid,))(meshes.mesh_source)


@derived(uses=(Grid,), gather=(Grid.ship,))
def mesh_sources(ship: tuple[ShipName, ...]) -> tuple[MeshSource, ...]:
    """Return the sources of all ships."""
    return tuple(map(meshes.mesh_source, ship))


@derived(uses=(Render,))
def drawing_engine(engine: str, tolerance: float | None) -> str:
    """Return the name of the rendering engine; `ConfigurationError` if it does not start."""
    if tolerance is not None and engine not in ("auto", LINES):
        raise ConfigurationError(
            f"render.tolerance is {tolerance:g}, but must be null where render.engine is {engine}, "
            "which draws pixels of one size"
        )
    if engine == LINES or tolerance is not None:
        return LINES
    try:
        return choose_engine(engine)
    except EngineError as error:
        raise ConfigurationError(f"render.engine is {engine!r}: {error}") from error


def drawing_engines(choices: Choices) -> tuple[str, ...]:
    """Return the names of all rendering engines; `ConfigurationError` if one does not start."""
    tolerances = choices[Render.tolerance]
    if None in tolerances and len(tolerances) > 1:
        raise ConfigurationError(
            "render.tolerance has null beside numbers, but must be all null or all numbers"
        )
    words = choices[Render.engine]
    return tuple(sorted({drawing_engine.function(word, tolerances[0]) for word in words}))


@derived(uses=(Grid, Scene))
def depression(
    range: float, geometry: str, depression: float, altitude: float, earth_radius: float
) -> float:
    """Return the depression [deg] at a slant range [m]; ValueError beyond the scene."""
    if geometry == "fixed":
        return depression
    return depression_angle(range, altitude=altitude, earth_radius=earth_radius)


@in_memory(keep=8)
def mesh(mesh_source: MeshSource) -> trimesh.Trimesh:
    """Return a ship's mesh, refused when its file has changed since its digest."""
    return meshes.read_mesh(mesh_source)


@derived(uses=(Grid, Render))
def drawn_aspect(mesh_source: MeshSource, aspect: float, skip: str) -> float:
    """Return the aspect [deg] to render: on the port side if the ship is symmetric."""
    if aspect <= 180 or skip == "none" or not meshes.is_symmetric(mesh_source):
        return aspect
    return round(360 - aspect, 9)  # so that it is the value that the grid has on that side


@derived(uses=(Grid, Render))
def drawn_range(
    mesh_source: MeshSource, range: float, tolerance: float | None, skip: str
) -> float | None:
    """Return the slant range [m] to draw a ship at, or None in the far field."""
    if skip == "none":
        return range
    return ncti.render.drawn_range(meshes.reach(mesh_source), range, tolerance=tolerance)


sampling = derived(uses=(Render,), reads={"engine": "drawing_engine"}, name="sampling")(Sampling)


@in_memory()
def image(
    mesh: trimesh.Trimesh,
    drawn_aspect: float,
    depression: float,
    drawn_range: float | None,
    sampling: Sampling,
    fineness: tuple[float, ...],
) -> RangeImage | LineImage | Mask:
    """Return the image at the configured pixel, or finer where that has few samples.

    With a tolerance, lines are as fine as it requires, starting at one per pixel.
    """
    if not fineness:
        view = {"aspect": drawn_aspect, "depression": depression}
        return sampling.draw(mesh, slant_range=drawn_range, **view)
    tolerance, pulse_width, bin_width = fineness
    return lines_within(
        mesh,
        View(drawn_aspect, depression, sampling.roll_at(drawn_aspect), drawn_range),
        tolerance=sampling_tolerance(tolerance, drawn_range),
        pulse_width=pulse_width,
        bin_width=bin_width,
        spacing=sampling.pixel,
    )


def image_stages(
    name: str, *, range: Setting, below: Any = None, engine: str = "drawing_engine"
) -> tuple[Stage, ...]:
    """Return a stage that draws ships at another range, preceded by the stages it needs.

    Its depression comes from a setting or stage (`below`), by default from the scene at the range;
    its engine comes from a derived stage. Images of equal depression, drawn range and engine are
    one result, whichever stage requests them.
    """
    range_stage = replace(drawn_range, name=f"{name}_range", reads={"range": range})
    sampling_stage = replace(sampling, name=f"{name}_sampling", reads={"engine": engine})
    depression_stage = replace(depression, name=f"{name}_depression", reads={"range": range})
    reads = {
        "depression": below or depression_stage.name,
        "drawn_range": range_stage.name,
        "sampling": sampling_stage.name,
    }
    return range_stage, sampling_stage, depression_stage, replace(image, name=name, reads=reads)


def uses_sensor(sensor: str) -> Condition:
    """Return the condition that a sensor is among those of the sweep."""
    return lambda choices: sensor in choices.value(Sweep.sensor)


def check(choices: Choices) -> None:
    """Refuse (`ConfigurationError`) ships that do not exist or are unfit."""
    meshes.check(choices[Grid.ship])


def check_ranges(choices: Choices, setting: Setting, beam: Setting, *, part: float = 1.0) -> None:
    """Refuse (`ConfigurationError`) slant ranges beyond the scene or refused by `check_beam`."""
    scenes = (choices[setting] for setting in (Scene.geometry, Scene.altitude, Scene.earth_radius))
    for slant_range, (geometry, *earth) in product(choices[setting], [*product(*scenes)]):
        try:
            depression(setting.in_si(slant_range), geometry, 0.0, *earth)
        except ValueError as error:
            raise ConfigurationError(f"{setting.key} has {slant_range:g}: {error}") from error
    check_beam(choices, setting, beam, part=part)


def check_beam(choices: Choices, setting: Setting, beam: Setting, *, part: float = 1.0) -> None:
    """Refuse (`ConfigurationError`) slant ranges at which pixels do not resolve part of a beam."""
    nearest, narrowest = min(choices[setting]), part * min(choices[beam])
    width, pixel = beam.in_si(narrowest) * setting.in_si(nearest), max(choices[Render.pixel])
    if width < pixel:
        words = beam.key if part == 1 else f"half {beam.key}"
        refuse(
            *(setting, f"{nearest:g}, where {words} of {narrowest:g} urad is {width:.2g} m wide"),
            f"at least render.pixel, {pixel:g} m",
        )


STATUS = Status("view", "state of the sensors' results for a view", (Grid.ship, Grid.aspect))


def loops(choices: Choices) -> list[CompiledLoops]:
    """Return the compiled loops of the engines, and of the binning of their pixels."""
    used = {*choices[Render.engine]}
    return [*map(engine_loops, sorted(used)), *([BOXES] if used != {LINES} else [])]


WORDS = {Sweep.sensor: "SENSOR"}

STAGES = (
    mesh_source,
    mesh_sources,
    drawing_engine,
    depression,
    mesh,
    drawn_aspect,
    drawn_range,
    sampling,
    image,
)
