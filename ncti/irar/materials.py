"""Facets that the article says reflect unlike the rest: inputs of a flight, not results."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require

if TYPE_CHECKING:
    import trimesh

TRANSOM_DEPTH = 4.0
"""Length of the stern in which facets that look aft are the transom [m]: as long as one takes that
slopes at 45 deg, and short of the step to the flight deck."""

LOOKS_AFT = 0.5
"""Least component of a transom facet's normal towards the stern."""

MAST_HEIGHT = 0.5
"""Height above which facets are of masts, over that of the highest."""


def transom(mesh: trimesh.Trimesh) -> NDArray[np.bool_]:
    """(facet,): facets of the transom, at the stern's end, under its deck, and looking aft."""
    centre, normal = mesh.triangles_center, mesh.face_normals
    stern = centre[:, 0] < mesh.bounds[0, 0] + TRANSOM_DEPTH
    found: NDArray[np.bool_] = stern & (normal[:, 0] < -LOOKS_AFT)
    return found


def masts(mesh: trimesh.Trimesh) -> NDArray[np.bool_]:
    """(facet,): facets higher than half the ship: masts, their yards and antennas."""
    found: NDArray[np.bool_] = mesh.triangles_center[:, 2] > MAST_HEIGHT * mesh.bounds[1, 2]
    return found


def reflectivity(
    mesh: trimesh.Trimesh, *, transom_gain: float = 1.0, mast_gain: float = 1.0
) -> NDArray[np.float64]:
    """Reflectivity of every facet, relative to the ship's.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    transom_gain : float
        Of the transom: 0 is dark.
    mast_gain : float
        Of the masts: above 1 they glint.

    Returns
    -------
    (facet,) float64 ndarray

    Raises
    ------
    ValueError
        If a gain is negative or not finite.

    Notes
    -----
    Article, 'Validation of Synthetic Range Profiles': it explains that the measured ship shows no
    transom by the 45 deg of its plate, and stronger masts by specular struts. A diffuse model
    gives neither; both are put in on its word, so what they change is no evidence for them.
    """
    require("transom_gain", transom_gain, minimum=0, maximum=1000)
    require("mast_gain", mast_gain, minimum=0, maximum=1000)
    gains = np.ones(len(mesh.faces))
    gains[transom(mesh)] *= transom_gain
    gains[masts(mesh)] *= mast_gain
    return gains
