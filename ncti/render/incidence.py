"""Cosines of incidence at which a facet counts as steep, or as edge-on."""

STEEPEST = 1e-4
"""Smallest cosine of incidence that is not edge-on. A steeper facet is narrower than the grid of a
rasteriser and seen by chance; the bound keeps its slope finite."""

STEEP = 0.1
"""Cosine of incidence below which the place of a facet's border on that grid matters: at slope 10,
half a step of the grid, 1/512 pixel, is 5 mm of range with 0.25 m pixels."""
