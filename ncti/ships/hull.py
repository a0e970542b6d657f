"""The hull above the waterline: faired lines through the stations of a sheet, lofted every metre.

Sheet axes: x aft from the stem, y to starboard, z up from the waterline.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from manifold3d import Manifold
from numpy.typing import ArrayLike, NDArray

from ncti.ships.lofting import loft

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

FLARE_POWER = 1.2  # half-breadth grows from the waterline to the deck as height to this power
STEM_HEIGHT = 0.25  # the stem's face at its head [m]
LEVELS = np.linspace(0, 1, 8)


@dataclass(frozen=True, eq=False)
class Hull:
    """Lines of a hull.

    `loa` [m] is the length overall. `stations` (n, 4) [m] have distance from the stem, height of
    the weather deck at side, half-breadth at the deck and at the waterline, NaN where the section
    does not reach the water. `stem_foot` [m] is the distance from the stem's head to its waterline
    point, `transom_head` [m] the height of the transom's upper edge, the aftermost point, and
    `transom_angle` [deg] the transom's angle to the vertical, with its foot further forward.
    """

    loa: float
    stations: NDArray[np.float64]
    stem_foot: float
    transom_head: float
    transom_angle: float

    @cached_property
    def _deck(self) -> PchipInterpolator:
        return _monotone_cubics(self.stations[:, 0], self.stations[:, 1:3])

    @cached_property
    def _waterline(self) -> PchipInterpolator:
        x, half = self.stations[:, 0], self.stations[:, 3:]
        wet = ~np.isnan(half[:, 0])
        return _monotone_cubics(x[wet], half[wet])

    def deck_edge(self, x: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return half-breadth and height of the weather deck at side [m].

        Monotone cubics keep the fairing within the stations: no bulge exceeds the beam, and a
        break of deck (two stations 0.1 m apart) stays a step.
        """
        edge = self._deck(np.clip(x, 0, self.loa))
        return edge[..., 1], edge[..., 0]

    def _flare_head(self, x: NDArray[np.float64], deck: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the height [m] at which a section reaches its breadth at the deck.

        It is the height of the deck, but falls to the lower deck over the last 20 m before a break
        of deck, so that the side continues through the break without a jog.
        """
        head = deck.copy()
        for before, after in pairwise(self.stations):
            drop = before[1] - after[1]
            if after[0] - before[0] < 0.2 and drop > 0.3:
                lead = before[0] + 1e-9 - x
                head -= drop * np.where(lead >= 0, np.clip(1 - lead / 20, 0, 1), 0)
        return head

    def solid(self) -> Manifold:
        """Return the hull from the waterline to the weather deck."""
        every_metre = np.arange(0, self.loa)
        station_x = self.stations[:, 0]
        between = np.abs(every_metre[:, None] - station_x).min(axis=1) > 0.05
        # Half a metre past the transom's head, for the transom's plane to cut.
        x = np.sort(np.concatenate([every_metre[between], station_x, [self.loa + 0.5]]))
        half_deck, deck = self.deck_edge(x)
        wet = self.stations[~np.isnan(self.stations[:, 3]), 0]
        half_water = self._waterline(np.clip(x, wet[0], wet[-1]))[:, 0]
        dry = x < self.stem_foot
        half_water[dry] = half_deck[0]
        stem = (deck[0] - STEM_HEIGHT) * (1 - x / self.stem_foot)
        foot = np.where(dry, np.minimum(stem, deck - STEM_HEIGHT), 0.0)

        height = (deck - foot)[:, None] * LEVELS
        share = np.minimum(height / (self._flare_head(x, deck) - foot)[:, None], 1)
        half = half_water[:, None] + (half_deck - half_water)[:, None] * share**FLARE_POWER
        z = foot[:, None] + height
        # From the deck edge to starboard down, across the bottom and up the port side.
        y = np.concatenate([half[:, ::-1], -half], axis=1)
        z = np.concatenate([z[:, ::-1], z], axis=1)
        rings = np.stack([np.broadcast_to(x[:, None], y.shape), y, z], axis=-1)

        lean = np.radians(self.transom_angle)
        forward = np.array([-np.cos(lean), 0.0, np.sin(lean)])
        offset = float(forward @ [self.loa, 0.0, self.transom_head])
        return loft(rings).trim_by_plane(tuple(forward), offset)


def _monotone_cubics(x: NDArray[np.float64], y: NDArray[np.float64]) -> PchipInterpolator:
    """Return cubics through (knot,) and (knot, curve), monotone wherever the knots are."""
    from scipy.interpolate import PchipInterpolator

    with np.errstate(all="ignore"):  # stations may nearly coincide
        return PchipInterpolator(x, y)
