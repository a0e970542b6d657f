"""Side view of a ship as SVG, for notebooks."""

from __future__ import annotations

import html
from collections.abc import Iterable

import numpy as np
from manifold3d import CrossSection, FillRule
from numpy.typing import NDArray

WIDTH = 480  # of a drawing [pixel]

Floats = NDArray[np.float64]


def side_view(name: str, vertices: Floats, faces: NDArray[np.integer]) -> str:
    """Return the silhouette of a ship seen from starboard, bow to the right, as SVG."""
    (left, _, low), (right, _, high) = vertices.min(axis=0), vertices.max(axis=0)
    scale = WIDTH / (right - left)
    view = (vertices[:, [0, 2]] - [left, low]) * scale
    height = (high - low) * scale
    corners = view[faces]
    (run, rise), (other_run, other_rise) = (corners[:, 1:] - corners[:, :1]).transpose(1, 2, 0)
    # Facets that face starboard run counter-clockwise there.
    silhouette = CrossSection(list(corners[run * other_rise > rise * other_run]), FillRule.NonZero)
    path = "".join(
        f"M{'L'.join(f'{x:.1f} {height - z:.1f}' for x, z in ring)}z"
        for ring in silhouette.to_polygons()
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height:.0f}" '
        f'viewBox="0 0 {WIDTH} {height:.1f}" role="img"><title>{html.escape(name)}</title>'
        f'<path d="{path}" fill="#7d94a8"/></svg>'
    )


def figure(name: str, vertices: Floats, faces: NDArray[np.integer], remarks: Iterable[str]) -> str:
    """Return a ship's silhouette above its measures and some remarks, as HTML."""
    caption = html.escape("; ".join((f"{name}: {measures(vertices, faces)}", *remarks)))
    picture = side_view(name, vertices, faces)
    return f"<figure>{picture}<figcaption>{caption}</figcaption></figure>"


def measures(vertices: Floats, faces: NDArray[np.integer]) -> str:
    """Return length x beam x height and the number of facets, as text."""
    length, beam, height = np.ptp(vertices, axis=0)
    return f"{length:.1f} x {beam:.1f} x {height:.1f} m, {len(faces):,} facets"
