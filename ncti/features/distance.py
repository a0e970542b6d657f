"""Distances between ships, and variants at a stated distance from their ship."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti import ships
from ncti.checks import require, require_all
from ncti.features.profile import profile_vector
from ncti.ladar import carrier_to_noise, expected_profile, range_extent
from ncti.render import line_image
from ncti.render.flight import DEPRESSION
from ncti.ships.perturbation import MAX_SIGMA_SCALE, Variant

if TYPE_CHECKING:
    import trimesh

ASPECTS = tuple(np.arange(7.5, 360, 15))
DISTANCE_ERROR = 0.05  # relative error of a stated distance
MAX_STEPS = 12


def ship_distance(
    first: trimesh.Trimesh,
    second: trimesh.Trimesh,
    *,
    aspects: ArrayLike = ASPECTS,
    depression: float = DEPRESSION,
    slant_range: float = 100e3,
    pulse_width: float = 30e-9,
) -> float:
    """Return the distance between two ships by their profile vectors.

    Parameters
    ----------
    first, second : trimesh.Trimesh
        Meshes of `ncti.ships.load`.
    aspects : (n,) array_like
        Aspects at which they are compared [deg].
    depression : float
        Depression [deg].
    slant_range : float
        Slant range [m].
    pulse_width : float
        1/e^2 pulse width [s].

    Returns
    -------
    float
        1 - mean cosine of the angle between their expected profile vectors at the same aspect: 0
        for equal ships, 1 for profiles that share no range bin.

    Raises
    ------
    ValueError
        If a parameter is out of range, or there are no aspects.

    See Also
    --------
    sister : Variant of a ship at a stated distance.
    ncti.classify.CorrelationNeighbour : Classifies by these cosines.

    Examples
    --------
    >>> import ncti
    >>> from ncti.features import ship_distance
    >>> duncan, texas = map(ncti.ships.load, ("duncan", "texas"))
    >>> print(f"{ship_distance(duncan, texas, aspects=[30, 210]):.2f}")
    0.15
    >>> ship_distance(duncan, duncan, aspects=[30]) < 1e-12
    True
    """
    angles = require_all("aspects", np.atleast_1d(aspects), minimum=-360.0, maximum=360.0)
    if angles.size == 0:
        raise ValueError("aspects has no values, but must have one or more")
    view = {"depression": depression, "slant_range": slant_range, "pulse_width": pulse_width}
    vectors = [_vectors(mesh, angles, **view) for mesh in (first, second)]
    return float(1 - np.einsum("ij,ij->i", *vectors).mean())


def _vectors(
    mesh: trimesh.Trimesh,
    aspects: NDArray[np.float64],
    *,
    depression: float,
    slant_range: float,
    pulse_width: float,
) -> NDArray[np.float64]:
    """Return expected profile vectors of unit length, (aspect, bin)."""
    cnr = carrier_to_noise(slant_range)
    profiles = []
    for aspect in aspects:
        lines = line_image(mesh, aspect=float(aspect), depression=depression)
        extent = range_extent(lines, slant_range=slant_range)
        profiles.append(expected_profile(extent, pulse_width=pulse_width, cnr=cnr))
    vectors = profile_vector(profiles)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def sister(
    name: str, distance: float, *, seed: int = 0, number: int = 1, **view: float
) -> trimesh.Trimesh:
    """Return a sister ship: a variant at a stated distance from its ship.

    Parameters
    ----------
    name : str
        One of `ncti.ships.names()`.
    distance : float
        Distance by `ship_distance`, between 0.0001 and 0.5.
    seed, number : int
        Variant of `ncti.ships.variants` whose scale is adjusted.
    **view
        `aspects`, `depression`, `slant_range` and `pulse_width` of `ship_distance`.

    Returns
    -------
    trimesh.Trimesh
        The variant, whose name in its metadata includes its scale. Its distance is within 5 % of
        the stated one.

    Raises
    ------
    ValueError
        If the variant is not that far away at any scale that can be built, or a parameter is out
        of range.

    See Also
    --------
    ncti.ships.variants : Variants within the uncertainty of a sheet.

    Notes
    -----
    Distance grows with the scale, nearly as its square, as long as no draw has to be repeated; the
    scale is found by bisection of its logarithm.

    Examples
    --------
    >>> from ncti.features import sister
    >>> near = sister("connole", 0.01, aspects=[30, 150])
    >>> near.metadata["variant_of"]
    'connole'
    """
    require("distance", distance, minimum=1e-4, maximum=0.5)
    ship = ships.load(name)
    low, high = np.log(0.01), np.log(MAX_SIGMA_SCALE)
    nearest = 0.0
    for step in range(MAX_STEPS):
        middle = high if step == 0 else (low + high) / 2
        scale = float(f"{np.exp(middle):.3g}")
        variant = ships.load(str(Variant(name, seed, number, scale)))
        nearest = ship_distance(ship, variant, **view)
        if abs(nearest / distance - 1) <= DISTANCE_ERROR:
            return variant
        if nearest < distance:
            low = middle
        else:
            high = middle
    raise ValueError(
        f"distance is {distance:g}, but variant {number} of seed {seed} of {name} comes no nearer "
        f"to it than {nearest:.3g}"
    )
