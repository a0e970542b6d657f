"""Reflectivity of transom and mast facets after the article: assumed inputs, not results."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require

if TYPE_CHECKING:
    import trimesh

TRANSOM_DEPTH = 4.0
"""Length of the stern in which facets that face aft belong to the transom [m]: enough for a transom
that slopes at 45 deg, and short of the step to the flight deck.
"""

LOOKS_AFT = 0.5
"""Least component of a transom facet's normal towards the stern."""

MAST_HEIGHT = 0.5
"""Height above which facets belong to masts, over the height of the ship."""


def transom(mesh: trimesh.Trimesh) -> NDArray[np.bool_]:
    """Return the mask (facet,) of the transom: at the stern's end and facing aft."""
    centre, normal = mesh.triangles_center, mesh.face_normals
    stern = centre[:, 0] < mesh.bounds[0, 0] + TRANSOM_DEPTH
    return stern & (normal[:, 0] < -LOOKS_AFT)


def masts(mesh: trimesh.Trimesh) -> NDArray[np.bool_]:
    """Return the mask (facet,) of masts, yards and antennas: above half the ship's height."""
    return mesh.triangles_center[:, 2] > MAST_HEIGHT * mesh.bounds[1, 2]


def reflectivity(
    mesh: trimesh.Trimesh, *, transom_gain: float = 1.0, mast_gain: float = 1.0
) -> NDArray[np.float64]:
    """Return the reflectivity of every facet, relative to the ship's.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    transom_gain : float
        Reflectivity of the transom: 0 is dark.
    mast_gain : float
        Reflectivity of the masts: above 1 they glint.

    Returns
    -------
    (facet,) float64 ndarray
        Relative reflectivity.

    Raises
    ------
    ValueError
        If a gain is negative or not finite.

    See Also
    --------
    fly : A pass by a ship with this reflectivity.

    Notes
    -----
    The article explains the measured ship's missing transom by the 45 deg slope of its plate, and
    its strong masts by specular struts [1]_. A diffuse model gives neither. Both gains are assumed
    inputs: their effect is no evidence for the explanation.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Validation of Synthetic Range Profiles'.

    Examples
    --------
    >>> import trimesh
    >>> box = trimesh.creation.box((40, 10, 14)).apply_translation((0, 0, 7))
    >>> reflectivity(box, transom_gain=0.0)
    array([0., 1., 0., 1., 1., 1., 1., 1., 1., 1., 1., 1.])
    """
    require("transom_gain", transom_gain, minimum=0, maximum=1000)
    require("mast_gain", mast_gain, minimum=0, maximum=1000)
    gains = np.ones(len(mesh.faces))
    gains[transom(mesh)] *= transom_gain
    gains[masts(mesh)] *= mast_gain
    return gains
