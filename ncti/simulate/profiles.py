"""Range profiles of a ship, averaged over frames."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all
from ncti.labels import labelled_array
from ncti.ladar.beam import Beam, Signal
from ncti.ladar.budget import MAX_DECIBELS, carrier_to_noise, power_ratio
from ncti.ladar.expected import expected_profile
from ncti.ladar.extent import bins_of
from ncti.ladar.frames import averaged_frames
from ncti.ladar.loops import FRAMES
from ncti.ladar.pulse import noise_floor, shortest_pulse
from ncti.ladar.tolerance import extent_within
from ncti.ladar.window import check_window
from ncti.machine_code import compiling_ahead
from ncti.render.flight import DEPRESSION
from ncti.render.loops import PIECES
from ncti.render.surfaces import Surfaces
from ncti.render.view import View
from ncti.simulate.subject import (
    SPACING,
    Ship,
    attributes_of,
    check_frames,
    check_sight,
    coordinates,
    generator,
    read_ship,
    roll_at,
)

if TYPE_CHECKING:
    import xarray as xr

    from ncti.ships.shape import Mesh

Floats = NDArray[np.float64]

MAX_PULSE_WIDTH = 1e-6
"""Longest pulse [s], as in sweeps."""

MAX_PLACES = 2**28
"""Most range bins of all IFOVs of the box around a ship; a view then takes up to 2 GB."""


def range_profile(
    ship: Ship,
    *,
    aspect: float | Sequence[float],
    pulse_width: float = Signal.pulse_width,
    slant_range: float = 100e3,
    frames: int = 16,
    accuracy: float = 1e-3,
    depression: float = DEPRESSION,
    ifov: float = Beam.ifov,
    bin_width: float = Beam.bin_width,
    window: float = Beam.window,
    cnr_db: float | None = None,
    target_free_ifovs: int = Signal.target_free_ifovs,
    rng: int | np.random.Generator = 0,
) -> xr.DataArray:
    """Simulate the laser-radar range profile of a ship, averaged over frames.

    Parameters
    ----------
    ship : str, Path or trimesh.Trimesh
        A name of `ncti.ships.names()`, the path of a sheet or mesh, or a closed mesh in the ship
        frame [m].
    aspect : float or (aspect,) sequence of float
        Bearing of the sensor from the ship [deg], 0 at the bow, growing to port.
    pulse_width : float
        Full width of the pulse at 1/e^2 of the intensity [s].
    slant_range : float
        Sensor to ship origin [m].
    frames : int
        Frames averaged.
    accuracy : float
        Largest error of the range extent after the pulse, sum |p - q| / sum q: as many lines across
        the ship as it takes, down to 1/256 m apart. The ship is drawn at its slant range, unless
        `ncti.render.drawn_range` allows the far field.
    depression : float
        Angle of the line of sight below the horizontal [deg].
    ifov : float
        Side of the square instantaneous field of view [rad].
    bin_width : float
        Range bin [m].
    window : float
        Length of the range window [m], centred on the ship origin.
    cnr_db : float, optional
        Carrier-to-noise ratio of a filled IFOV [dB]; when not given,
        `ncti.ladar.carrier_to_noise` at the slant range, 32 dB at 100 km.
    target_free_ifovs : int
        Target-free IFOVs that each frame also accumulates.
    rng : int or numpy.random.Generator
        Source of randomness, or a seed, which gives each aspect a separate stream. Streams are the
        same for every ship: use a different seed for each ship if their noise must be independent.

    Returns
    -------
    ([aspect,] down_range) xarray.DataArray
        Averaged amplitude less its expected noise floor, in units in which one target-free IFOV
        has `ncti.ladar.noise_floor()`. The coordinate `expected`, of the same dimensions, is the
        expected profile less the same floor. Attributes: `error_bound`, the largest over aspects,
        and `accuracy_reached`, "yes" if it is within `accuracy`, else "no", beside the settings.
        The bound is an estimate: one or two views in a thousand report "yes" wrongly.

    Raises
    ------
    ValueError
        If the ship cannot be loaded, the window does not hold it and the returned pulse, its IFOVs
        do not fit into memory, or a parameter is out of its range.

    See Also
    --------
    infrared_image : The ship as the passive sensor sees it.
    ncti.ladar.sample_frames : The frames one by one.
    ncti.ladar.extent_within : Range extents of a given accuracy.
    ncti.features.profile_vector : The profile as classifiers take it.

    Notes
    -----
    Speckle and noise follow Equations A and B of [1]_, and the expected profile Equation C. A
    sweep with ``render.tolerance`` equal to `accuracy` stores the same expected profile, floor
    included.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, MIT Lincoln Laboratory, Appendix 1.

    Examples
    --------
    >>> import ncti
    >>> profile = ncti.simulate.range_profile("duncan", aspect=37, frames=16)
    >>> profile.sizes["down_range"], profile.attrs["accuracy_reached"]
    (250, 'yes')

    ``profile.plot()`` draws it, and ``profile.expected.plot()`` adds the expected profile. The
    ship ends where the expected profile does:

    >>> bins = profile.down_range[profile.expected > 1]
    >>> float(bins.max() - bins.min())
    110.0
    """
    aspects = _checked_aspects(aspect)
    frames = check_frames(frames)
    require("accuracy", accuracy, positive=True, maximum=1.0)
    check_sight(slant_range, ifov)
    if cnr_db is not None:
        require("cnr_db", cnr_db, minimum=-MAX_DECIBELS, maximum=MAX_DECIBELS)
    ratio = carrier_to_noise(slant_range) if cnr_db is None else power_ratio(cnr_db)
    beam = Beam(ifov, bin_width, window)
    signal = Signal(pulse_width, ratio, target_free_ifovs)
    _check_binning(beam, pulse_width)
    generator(rng, aspect=0.0)
    with compiling_ahead(PIECES, FRAMES):
        mesh = read_ship(ship)
        sight: dict[str, Any] = {"depression": depression, "slant_range": slant_range}
        views = [View.checked(aspect=a, roll=roll_at(a), **sight) for a in aspects]
        _check_fits(mesh, views, beam, pulse_width)
        fine = {"tolerance": accuracy, "pulse_width": pulse_width, "spacing": SPACING}
        extents = [extent_within(mesh, view, beam=beam, **fine) for view in views]
    averaged, expected = [], []
    for extent, bearing in zip(extents, aspects, strict=True):
        stream = generator(rng, aspect=bearing)
        [average] = averaged_frames(extent, [frames], rng=stream, **vars(signal))
        floor = (len(extent.fraction) + target_free_ifovs) * noise_floor()
        averaged.append(average - floor)
        expected.append(expected_profile(extent, **vars(signal)) - floor)
    error = max(extent.error_after(pulse_width) for extent in extents)
    attributes = {
        **attributes_of(
            rng, slant_range=slant_range, depression=depression, frames=frames, ifov=ifov
        ),
        "pulse_width_ns": round(pulse_width * 1e9, 9),
        "cnr_db": 10 * math.log10(ratio),
        "target_free_ifovs": int(target_free_ifovs),
        "accuracy": float(accuracy),
        "error_bound": error,
        "accuracy_reached": "yes" if error <= accuracy else "no",
    }
    single = {"range": slant_range, "frame_count": frames, "pulse_width": pulse_width}
    coords = coordinates(mesh, aspect=aspect, **single)
    return _labelled_profiles((extents[0].down_range, averaged, expected), coords, attributes)


def _labelled_profiles(
    profiles: tuple[Floats, Sequence[Floats], Sequence[Floats]],
    coords: dict[str, Any],
    attributes: dict[str, Any],
) -> xr.DataArray:
    """Return profiles with their coordinates and attributes."""
    import xarray as xr

    down_range, *curves = profiles
    single = coords["aspect"][1].ndim == 0
    averaged, expected = (rows[0] if single else np.stack(rows) for rows in curves)
    dims = ("aspect", "down_range")[-averaged.ndim :]
    label = {"units": "1", "long_name": "amplitude above the noise floor"}
    coords["down_range"] = labelled_array("down_range", down_range, "m", "down-range")
    coords["expected"] = (dims, expected, label)
    return xr.DataArray(averaged, coords, dims, name="averaged", attrs={**label, **attributes})


def _checked_aspects(aspect: ArrayLike) -> list[float]:
    """Return aspects [deg] as a list; raise `ValueError` if it is empty or out of range."""
    require_all("aspect", aspect, minimum=-360.0, maximum=360.0)
    if np.ndim(aspect) > 1 or np.size(aspect) == 0:
        raise ValueError(f"aspect has shape {np.shape(aspect)}, but must be one number or a list")
    return np.atleast_1d(np.asarray(aspect, dtype=np.float64)).tolist()


def _check_binning(beam: Beam, pulse_width: float) -> None:
    """Raise `ValueError` for a window of too many bins, or a pulse [s] too short for them."""
    bins_of(beam.window, beam.bin_width)
    shortest, longest = pulse_bounds(beam.bin_width)
    require("pulse_width", pulse_width, minimum=shortest, maximum=longest)


def pulse_bounds(bin_width: float) -> tuple[float, float]:
    """Return the shortest and the longest pulse [s] for range bins of a width [m]."""
    shortest = shortest_pulse(bin_width) * (1 - 1e-9)  # a margin for rounding
    return shortest, max(MAX_PULSE_WIDTH, shortest)


def _check_fits(mesh: Mesh, views: Sequence[View], beam: Beam, pulse_width: float) -> None:
    """Raise `ValueError` if a ship does not fit into the window, or its IFOVs into memory."""
    check_window(beam.window, mesh, pulse_width=pulse_width)
    for view in views:
        level = replace(view, roll=0.0)  # IFOVs are not rolled
        _check_memory(mesh, level, beam.ifov, bins_of(beam.window, beam.bin_width)[1])


def _check_memory(mesh: Mesh, view: View, ifov: float, bins: int) -> None:
    """Raise `ValueError` if a ship covers too many IFOVs for `bins` range bins."""
    across, up, depth = np.abs(view.axes) @ Surfaces.of(mesh).size
    nearest = float(view.slant_range or 0.0) - depth / 2
    places = bins * across * up / (ifov * nearest) ** 2
    if nearest > 0 and places > MAX_PLACES:  # ships that reach the sensor are refused elsewhere
        narrowest = ifov * math.sqrt(places / MAX_PLACES)
        raise ValueError(
            f"ifov is {ifov!r} rad, but must be at least {narrowest:.2g} rad for {bins} range bins "
            f"of a ship of {across:.0f} m by {up:.0f} m at {view.slant_range:g} m"
        )
