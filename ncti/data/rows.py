"""Labelled rows of simulated signatures, drawn from ships and parameters by a seed."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import pairwise
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.data.draws import Bounds, sampler, uniform_numbers
from ncti.data.views import (
    IFOV_OFFSET,
    ROW_STREAM,
    SENSOR_SETS,
    VIEW,
    VIEW_STREAM,
    Arrays,
    Recipe,
    equal_rows,
    simulated,
)
from ncti.features.map_vector import map_cells
from ncti.infrared import IFOV, Imager
from ncti.infrared.imager import IMAGER
from ncti.labels import labelled_array
from ncti.ladar.beam import Beam, Signal
from ncti.ladar.budget import MAX_DECIBELS, carrier_to_noise
from ncti.ladar.extent import bin_centres
from ncti.ladar.window import check_window
from ncti.render.far_field import NEGLIGIBLE
from ncti.render.flight import DEPRESSION
from ncti.simulate.profiles import pulse_bounds
from ncti.simulate.subject import (
    MAX_SLANT_RANGE,
    MIN_SLANT_RANGE,
    SPACING,
    Ship,
    check_sight,
    read_ship,
)

if TYPE_CHECKING:
    import xarray as xr

RANDOM = "random"
MAX_ROWS = 10_000_000  # per call: 10 GB of profiles
MAX_FRAMES = 10_000
NUMBERS = {
    "count": Bounds(1, MAX_ROWS, whole=True),
    "seed": Bounds(0, 2**63, whole=True),
    "first": Bounds(0, 2**53 - MAX_ROWS, whole=True),
    "workers": Bounds(1, 1024, whole=True),
    "rows_per_view": Bounds(1, MAX_ROWS, whole=True),
    "target_free_ifovs": Bounds(0, 2**53, whole=True),
    "spacing": Bounds(0.01, 2.0),  # m
    "far_field_error": Bounds(1e-12, 1.0),
}
"""Numbers that are the same for all rows, and their bounds."""

ROWS_AT_ONCE = 2000  # per batch: some seconds of a process

ROWS = {
    "row": "number of the row",
    "ship": "ship",
    "view": "number of the view",
    "aspect": ("degree", "aspect, 0 bow-on, 90 port beam"),
    "depression": ("degree", "depression of the line of sight"),
    "slant_range": ("m", "slant range"),
    "pulse_width": ("s", "pulse width, full width at 1/e^2"),
    "cnr": ("dB", "carrier-to-noise ratio of a filled IFOV"),
    "frames": ("1", "frames averaged"),
    "gain": ("1", "gain of the target above the noise floor"),
    "floor": ("1", "shift of the noise floor, in rms deviations of a frame"),
    "right": ("1", "place of the ship origin, right of the corner of its IFOV"),
    "up": ("1", "place of the ship origin, above the corner of its IFOV"),
    "error_bound": ("1", "bound on the error of the range extent after the pulse"),
}
"""Coordinates of rows, with their units if they have any, and labels."""

BINS = ("row", "down_range")
VARIABLES = {
    "profile": (BINS, "frame-averaged range profile, noise floor included"),
    "expected": (BINS, "expected range profile, noise floor included"),
    "silhouette": (("row", "angle", "radius"), "log-polar map of the segmented silhouette, 255ths"),
}
RADAR_DEFAULTS: dict[str, Any] = {
    "pulse_width": Signal.pulse_width,
    "cnr": None,
    "gain": 1.0,
    "floor": 0.0,
    "expected": False,
}
"""Arguments that only a laser radar has, and their defaults."""

RADAR_COORDINATES = (*RADAR_DEFAULTS, *IFOV_OFFSET, "error_bound")
"""Coordinates that only rows of a laser radar have."""


def dataset(
    ships: Sequence[Ship],
    count: int,
    *,
    seed: int,
    first: int = 0,
    workers: int = 1,
    sensor: str = "range",
    aspect: Any = RANDOM,
    depression: Any = DEPRESSION,
    slant_range: Any = 100e3,
    pulse_width: Any = RADAR_DEFAULTS["pulse_width"],
    cnr: Any = RADAR_DEFAULTS["cnr"],
    frames: Any = 16,
    gain: Any = RADAR_DEFAULTS["gain"],
    floor: Any = RADAR_DEFAULTS["floor"],
    rows_per_view: int = 25,
    ifov: float = IFOV,
    bin_width: float = Beam.bin_width,
    window: float = Beam.window,
    target_free_ifovs: int = Signal.target_free_ifovs,
    spacing: float = SPACING,
    far_field_error: float = NEGLIGIBLE,
    expected: bool = RADAR_DEFAULTS["expected"],
    imager: Imager = IMAGER,
    super_resolution: str = "none",
) -> xr.Dataset:
    """Return labelled rows of simulated signatures, with every parameter that was drawn.

    A parameter that may be drawn is a value; a list of equally probable values; a tuple
    (low, high), drawn uniformly between; or a frozen distribution of `scipy.stats`.

    Parameters
    ----------
    ships : sequence of str, Path or trimesh.Trimesh
        Ships: names, paths or meshes as of `ncti.simulate.range_profile`. Each block of as many
        views as there are ships shows every ship once, in random order.
    count : int
        Number of rows.
    seed : int
        Seed. A row depends only on the seed and on its number, so a smaller data set is the
        beginning of a larger one.
    first : int
        Number of the first row: rows of one seed can be made in parts, in any order.
    workers : int
        Processes. In a script, more than one needs the guard ``if __name__ == "__main__":``.
    sensor : {"range", "infrared", "both"}
        The laser radar, the passive-infrared imager, or both at the same view.
    aspect : "random", or drawn
        Bearing of the sensor from the ship [deg], 0 at the bow, growing to port; `random` for
        (0, 360).
    depression : drawn
        Angle of the line of sight below the horizontal [deg].
    slant_range : drawn
        Sensor to ship origin [m].
    pulse_width : drawn
        Full width of the pulse at 1/e^2 of the intensity [s].
    cnr : drawn, optional
        Carrier-to-noise ratio of a filled IFOV [dB]; when not given,
        `ncti.ladar.carrier_to_noise` at the slant range, 32 dB at 100 km.
    frames : drawn
        Frames averaged, by each sensor; an interval includes both its ends.
    gain : drawn
        Amplitude gain of the target: the factor of its expected profile above the floor.
    floor : drawn
        Shift of the noise floor in all bins, in rms deviations of a frame of the view. Gain and
        floor are the unknowns of `ncti.classify.GaussianTemplates`; noise is drawn at the nominal
        gain.
    rows_per_view : int
        Rows of a view, numbered one after the other: ship, aspect, depression and slant range are
        drawn for each view, all else for each row. Views are rendered once.
    ifov : float
        Side of the square instantaneous field of view, or of the imager's pixels [rad].
    bin_width, window : float
        Range bin, and range window centred on the ship origin [m].
    target_free_ifovs : int
        Target-free IFOVs that each frame also accumulates.
    spacing : float
        Distance between lines across the ship [m].
    far_field_error : float
        Largest relative error of range extents from drawing the far field instead of the slant
        range; an attribute of the result. Ranges share an image if the error allows it.
    expected : bool
        Whether to return the expectation of each profile as well.
    imager : ncti.infrared.Imager
        The imager, its noise, the air and the scene; those of sweeps when not given.
    super_resolution : {"none", "perfect", "shifted"}
        Pixels of the imager, or half of them, as of `ncti.infrared.image`.

    Returns
    -------
    xarray.Dataset
        Of the laser radar `profile` (row, down_range), the average of frames, noise floor included,
        as float32, and perhaps `expected`; of the imager `silhouette` (row, angle, radius), the
        log-polar map of the segmented silhouette in 255ths. Coordinates of rows: `ship`, `view`
        (its number), all parameters by their names here, `right` and `up`, the place of the ship
        origin in an IFOV, and `error_bound`, an estimate of the error of the range extent.

    Raises
    ------
    ValueError
        If a ship cannot be loaded or does not fit into the window, a parameter is out of range, or
        a parameter of the laser radar is given for the imager alone. All checks precede the
        simulation.

    See Also
    --------
    to_numpy : Vectors, labels and groups of the rows, as classifiers take them.
    ncti.simulate.range_profile : One profile.

    Notes
    -----
    Speckle and noise follow Equations A and B of [1]_, frame by frame, and images Appendix 2. The
    ship lies anywhere on the IFOVs, and anywhere on the imager's pixels; both places are drawn for
    each row. Its silhouette comes from the matched segmentation of `ncti.features.segment`. A
    distribution is sampled by inverting it at a random number of the row, so that a parameter does
    not change with the choice of the others.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, MIT Lincoln Laboratory, Appendices 1 and 2.

    Examples
    --------
    Sixty rows of two ships, twenty of a view, whose gain is off by 10 %:

    >>> import ncti
    >>> from scipy.stats import norm
    >>> rows = ncti.dataset(
    ...     ["duncan", "texas"], 60, seed=0, rows_per_view=20, frames=[4, 16], gain=norm(1, 0.1)
    ... )
    >>> rows.profile.dims, rows.sizes["row"]
    (('row', 'down_range'), 60)
    >>> X, y, groups = ncti.to_numpy(rows)
    >>> X.shape, len(set(groups))
    ((60, 250), 3)
    """
    names = _names(ships)
    count, first, workers, rows_per_view = _integers(
        count=count, first=first, workers=workers, rows_per_view=rows_per_view
    )
    seed, free = _integers(seed=seed, target_free_ifovs=target_free_ifovs)
    _check_numbers(spacing=spacing, far_field_error=far_field_error)
    recipe = Recipe(
        ships=tuple(ships),
        seed=seed,
        sensor=sensor,
        beam=Beam(ifov, bin_width, window),
        target_free_ifovs=free,
        imager=imager,
        super_resolution=super_resolution,
        spacing=spacing,
        far_field_error=far_field_error,
        expected=bool(expected),
    )
    radar_arguments = {"pulse_width": pulse_width, "cnr": cnr, "gain": gain, "floor": floor}
    if sensor == "infrared":
        _check_unused(radar_arguments | {"expected": expected})
    view_arguments = {"aspect": aspect, "depression": depression, "slant_range": slant_range}
    drawable = view_arguments | radar_arguments | {"frames": frames, "bin_width": bin_width}
    rows = np.arange(first, first + count)
    drawn = parameters(rows, len(names), seed=seed, rows_per_view=rows_per_view, **drawable)
    _check_views(recipe, drawn)
    arrays = _simulate_batches(recipe, drawn, workers)
    drawn["ship"] = np.array(names)[drawn["ship"]]
    return _labelled_rows(recipe, drawn | arrays, rows_per_view)


def _check_numbers(**numbers: float) -> None:
    """Raise `ValueError` for numbers out of the bounds of `NUMBERS`."""
    for name, value in numbers.items():
        require(name, value, **vars(NUMBERS[name]))


def _integers(**numbers: float) -> list[int]:
    """Return numbers as integers, or raise `ValueError` for those out of their bounds."""
    _check_numbers(**numbers)
    return [int(value) for value in numbers.values()]


def _check_unused(arguments: dict[str, Any]) -> None:
    """Raise `ValueError` for arguments of the laser radar in a data set without it."""
    for name, value in arguments.items():
        default = RADAR_DEFAULTS[name]
        if value is not default and not (np.isscalar(value) and value == default):
            raise ValueError(
                f"{name} is {value!r:.60}, but must not be given without a laser radar"
            )


def _bounds(bin_width: float) -> dict[str, Bounds]:
    """Return the bounds of parameters by name, those of views before those of rows."""
    return {
        "aspect": Bounds(-360.0, 360.0),
        "depression": Bounds(0.0, 90.0),
        "slant_range": Bounds(MIN_SLANT_RANGE, MAX_SLANT_RANGE),
        "pulse_width": Bounds(*pulse_bounds(bin_width)),
        "cnr": Bounds(-MAX_DECIBELS, MAX_DECIBELS),
        "frames": Bounds(1, MAX_FRAMES, whole=True),
        "gain": Bounds(0.0, 1000.0),
        "floor": Bounds(-1000.0, 1000.0),
    }


def _names(ships: Sequence[Ship]) -> list[str]:
    """Return the names of ships, or raise `ValueError` if there are none, or two equal ones."""
    if isinstance(ships, str) or not isinstance(ships, Sequence) or not ships:
        raise ValueError(f"ships is {ships!r:.60}, but must be a list of ships")
    names: list[str] = []
    for ship in ships:
        try:
            name = str(read_ship(ship).metadata.get("name", "mesh"))
        except ValueError as error:
            raise ValueError(f"ships has {ship!r:.60}: {error}") from error
        if name in names:
            raise ValueError(f"ships has {name!r} twice, but its ships must have different names")
        names.append(name)
    return names


def _check_views(recipe: Recipe, drawn: Arrays) -> None:
    """Raise `ValueError` for too narrow a beam, or a window without room at both its edges."""
    check_sight(float(drawn["slant_range"].min()), recipe.beam.ifov)
    if "range" not in SENSOR_SETS[recipe.sensor]:
        return
    longest = float(drawn["pulse_width"].max())
    for ship in recipe.ships:
        check_window(recipe.beam.window, read_ship(ship), pulse_width=longest)


def parameters(
    numbers: NDArray[np.int64],
    ships: int,
    *,
    seed: int,
    rows_per_view: int,
    bin_width: float = Beam.bin_width,
    cnr: Any = RADAR_DEFAULTS["cnr"],
    **given: Any,
) -> Arrays:
    """Return the parameters (row,) drawn for the rows of a data set, without simulating them.

    `numbers` (row,) are row numbers. The result includes `row`, `view`, and `ship` as an index. For
    the other arguments see `dataset`.
    """
    if isinstance(given["aspect"], str) and given["aspect"] == RANDOM:
        given["aspect"] = (0.0, 360.0)
    given["cnr"] = 0.0 if cnr is None else cnr
    bounds = _bounds(bin_width)
    samplers = {name: sampler(name, given[name], bounds[name]) for name in bounds}
    # A block has as many views as there are ships, one of each ship.
    view = numbers // rows_per_view
    blocks, block = np.unique(view // ships, return_inverse=True)
    views, view_of_row = blocks[:, None] * ships + np.arange(ships), block * ships + view % ships
    *view_names, row_names = VIEW[1:], [name for name in samplers if name not in VIEW]
    order, *uniform = uniform_numbers(seed, VIEW_STREAM, views.reshape(-1), len(VIEW))
    drawn: Arrays = {"row": numbers, "view": view}
    drawn["ship"] = order.reshape(views.shape).argsort(axis=1).reshape(-1)[view_of_row]
    for name, values in zip(*view_names, uniform, strict=True):
        drawn[name] = samplers[name](values)[view_of_row]
    *uniform, right, up = uniform_numbers(
        seed, ROW_STREAM, numbers, len(row_names) + len(IFOV_OFFSET)
    )
    for name, values in zip(row_names, uniform, strict=True):
        drawn[name] = samplers[name](values)
    drawn |= dict(zip(IFOV_OFFSET, (right, up), strict=True))
    drawn["frames"] = drawn["frames"].astype(np.int64)
    if cnr is None:
        budget = [10 * math.log10(carrier_to_noise(far)) for far in drawn["slant_range"].tolist()]
        drawn["cnr"] = np.array(budget)
    return drawn


def _simulate_batches(recipe: Recipe, drawn: Arrays, workers: int) -> Arrays:
    """Return the arrays of all rows, simulated in batches of views by `workers` processes."""
    # Sort equal views together, and all ranges of a ship and aspect.
    order = np.lexsort([drawn["row"], *(drawn[name] for name in reversed(VIEW))])
    ordered = {name: values[order] for name, values in drawn.items()}
    ends = np.array([rows.stop for rows in equal_rows(ordered, VIEW)])
    parts = max(len(order) // ROWS_AT_ONCE, 4 * workers if workers > 1 else 1)
    targets = len(order) * np.arange(1, parts) // parts
    cuts = np.unique([0, *ends[np.searchsorted(ends, targets)], len(order)]).tolist()
    batches = [
        {name: values[start:end] for name, values in ordered.items()}
        for start, end in pairwise(cuts)
    ]
    simulate = partial(simulated, recipe)
    if workers == 1:
        results = list(map(simulate, batches))
    else:
        context = get_context("spawn")
        with ProcessPoolExecutor(workers, context, initializer=_limit_line_threads) as pool:
            results = list(pool.map(simulate, batches))
    arrays = {}
    for name in list(results[0]):
        joined = np.concatenate([result.pop(name) for result in results])
        arrays[name] = np.empty_like(joined)
        arrays[name][order] = joined
    return arrays


def _limit_line_threads() -> None:
    """Limit this process to one thread of lines, since other processes use the cores."""
    os.environ["OMP_NUM_THREADS"] = "1"


def _labelled_rows(recipe: Recipe, arrays: Arrays, rows_per_view: int) -> xr.Dataset:
    """Return rows as an xarray data set."""
    import xarray as xr

    beam = recipe.beam
    attributes: dict[str, Any] = {
        "seed": recipe.seed,
        "sensor": recipe.sensor,
        "rows_per_view": rows_per_view,
        "ifov_urad": round(beam.ifov * 1e6, 9),
        "spacing_m": float(recipe.spacing),
        "far_field_error": float(recipe.far_field_error),
    }
    rows = dict(ROWS)
    coords: dict[str, Any] = {}
    if "range" in SENSOR_SETS[recipe.sensor]:
        attributes["target_free_ifovs"] = recipe.target_free_ifovs
        bins = bin_centres(beam.window, beam.bin_width)
        coords["down_range"] = labelled_array("down_range", bins, "m", "down-range")
    else:
        rows = {name: meaning for name, meaning in ROWS.items() if name not in RADAR_COORDINATES}
    if "infrared" in SENSOR_SETS[recipe.sensor]:
        attributes |= {**vars(recipe.imager), "super_resolution": recipe.super_resolution}
        angle, radius = map_cells()
        coords["angle"] = labelled_array("angle", angle, "degree", "angle about the centroid")
        coords["radius"] = labelled_array(
            "radius", radius, "1", "place between inner and outer log radius"
        )
    for name, meaning in rows.items():
        if isinstance(meaning, str):
            coords[name] = "row", arrays[name], {"long_name": meaning}
        else:
            coords[name] = labelled_array("row", arrays[name], *meaning)
    variables = {
        name: labelled_array(dims, arrays[name], "1", label)
        for name, (dims, label) in VARIABLES.items()
        if name in arrays
    }
    return xr.Dataset(variables, coords, attributes)
