"""A scan of the field of regard: the imager detects, the laser radar visits and identifies.

Ships of the grid and a decoy lie in it at random, at aspects that no template has.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import ladar, search
from ncti.ladar import RangeExtent
from ncti.search import Box
from sweeps.engine.settings import Settings, count, number, word
from sweeps.engine.stage import Output, Stage, plain, stage
from sweeps.stages import views
from sweeps.stages.ladar import Arrays, Ladar, profile_bins
from sweeps.stages.scan_tables import DECOY
from sweeps.stages.views import SCAN, STATUS, Grid, Render, looks, quantity

if TYPE_CHECKING:
    import trimesh

SENSOR = GROUP = SCAN
BARGE, NO_DECOY = "barge", "none"


class Scan(Settings, key="scan"):
    """The search of the field of regard.

    The source gives both fields (12 x 12 deg of the imager, 2 x 3 deg of the laser radar), the
    IFOV and the 2 x 2 detector. Rates, the imager's array and the decoy are assumptions.
    """

    width = quantity(3, 0.1, 60, "degree", "width of the field of regard")
    height = quantity(2, 0.1, 60, "degree", "height of the field of regard")
    detector = count(2, 1, 64, label="elements of the laser radar along a side of its detector")
    pulse_rate = quantity(
        *(1000, 1, 1e9, "Hz", "pulses of the laser radar a second, one a frame"),
        help="at most that of an unambiguous range",
    )
    imager_pixels = count(256, 1, 10**5, label="pixels along a side of the imager's array")
    imager_frames = count(16, 1, 10**4, label="frames averaged by the imager")
    frame_rate = quantity(30, 0.01, 1e6, "Hz", "frames of the imager a second")
    slew_time = quantity(0.1, 0, 100, "s", "time of a move to a visit, or of the imager's array")
    depth = number(0.05, 0, 0.5, label="share of the range by which targets are nearer or farther")
    decoy = word(
        BARGE,
        (BARGE, NO_DECOY),
        label="decoy among the ships",
        help="barge: a box as warm as the ships",
    )
    decoy_length = quantity(120, 1, 1000, "m", "length of the decoy")
    decoy_beam = quantity(20, 1, 1000, "m", "beam of the decoy")
    decoy_height = quantity(8, 0.1, 100, "m", "height of the decoy above the sea")
    known_views = count(64, 1, 10**4, label="views of each ship that set the rejection threshold")
    lost = number(0.05, 0, 0.99, label="share of known ships that the rejection threshold rejects")


of_scan = partial(stage, uses=(Scan, Grid, Render, Ladar), when=looks(SCAN), status=STATUS)


@plain(uses=(Render,))
def scan_drawn(drawing_engine: str, pixel: float, samples: int, roll: float) -> tuple[Any, ...]:
    """Return the rendering parameters of views."""
    return drawing_engine, pixel, samples, roll


@plain(uses=(Ladar,))
def scan_bins(ifov: float, bin_width: float, window: float, spread: float) -> tuple[float, ...]:
    """Return the binning of range extents: IFOV [rad], bin and window [m], and spread."""
    return ifov * 1e-6, bin_width, window, spread


@plain(uses=(Scan, Ladar))
def scan_field(width: float, height: float, ifov: float) -> tuple[float, float, float]:
    """Return the field's sides and its IFOV [rad]."""
    return math.radians(width), math.radians(height), ifov * 1e-6


@of_scan(
    Output("target", ("target",), "U64", label="target in the field"),
    group=GROUP,
    gather=(Grid.ship,),
    coordinates=True,
    status="",
)
def scan_names(ship: tuple[str, ...], decoy: str) -> NDArray[np.str_]:
    """Return the names of all targets."""
    return np.array([*map(str, ship), *([DECOY] if decoy != NO_DECOY else [])])


@of_scan(
    Output("edge", ("edge",), "U8", label="side of a box of pixels, the last two behind it"),
    group=GROUP,
    coordinates=True,
    status="",
)
def scan_edges() -> NDArray[np.str_]:
    """Return the names of a box's edges."""
    return np.array(Box._fields)


VIEW = (
    Output("true_aspect", dtype="f8"),
    Output("offset", dtype="f8"),  # of bearing, -1 to 1 of what its slot leaves
    Output("slant_range", dtype="f8"),
    Output("fraction", ("ifov", "down_range")),  # of as many IFOVs as any ship has, empty ones too
    Output("cell", ("ifov", "side"), "i4"),
)


@dataclass(frozen=True, eq=False)
class Target:
    """A ship or decoy in the field, from the arrays of `VIEW`."""

    aspect: float  # [deg]
    offset: float
    extent: RangeExtent

    @classmethod
    def of(cls, found: Arrays, bins: tuple[float, ...]) -> Target:
        """Return a target of some arrays, IFOVs without it left out."""
        ifov, bin_width, window, _ = bins
        seen = found["fraction"].any(axis=1)
        extent = RangeExtent(
            fraction=found["fraction"][seen].astype(np.float64),
            down_range=profile_bins(window, bin_width),
            bin_width=bin_width,
            cell=found["cell"][seen].astype(np.int64),
            ifov=ifov,
            slant_range=float(found["slant_range"]),
        )
        return cls(float(found["true_aspect"]), float(found["offset"]), extent)

    def shown(self, rule: float) -> NDArray[np.int64]:
        """(pixel, 2): pixels that show it, from its origin, of which it fills at least a share."""
        return self.extent.cell[self.extent.fraction.sum(axis=1) >= rule]

    def inside(self, box: Box) -> RangeExtent:
        """Return what is seen of it by the IFOVs of a box, which counts from its origin."""
        held = box.holds(self.extent.cell)
        parts = {"fraction": self.extent.fraction[held], "cell": self.extent.cell[held]}
        return RangeExtent(**{**vars(self.extent), **parts, "strands": None})


def view_of(
    mesh: trimesh.Trimesh,
    rng: np.random.Generator,
    aspects: tuple[float, ...],
    *,
    depth: float,
    slant_range: float,
    depression: float,
    most: tuple[int, int],
    drawn: tuple[Any, ...],
    bins: tuple[float, ...],
) -> Arrays:
    """Return the arrays of `VIEW` of a ship at a random aspect and position.

    Its aspect is anywhere between the first and the last that are learned. Its IFOVs differ by
    `most` columns and rows.
    """
    aspect = float(rng.uniform(min(aspects), max(aspects)))
    offset, deep = rng.uniform(-1, 1, 2).tolist()
    far = slant_range * (1 + depth * deep)
    down = math.radians(depression)
    up = search.elevation(far, middle_range=slant_range, depression=down) if down else 0.0
    engine, pixel, samples, roll = drawn
    below = math.degrees(down - up)
    image = views.image(mesh, aspect, below, far, engine, pixel, samples, roll, ())
    ifov, bin_width, window, spread = bins
    extent = ladar.range_extent(
        image, slant_range=far, ifov=ifov, bin_width=bin_width, window=window, spread=spread
    )
    empty = (most[0] + 1) * (most[1] + 1) - len(extent.cell)
    return {
        "true_aspect": np.array(aspect),
        "offset": np.array(offset),
        "slant_range": np.array(far),
        "fraction": np.pad(extent.fraction, ((0, empty), (0, 0))).astype(np.float32),
        "cell": np.pad(extent.cell, ((0, empty), (0, 0))),
    }


def targets_of(ships: Arrays, decoy: Arrays, bins: tuple[float, ...]) -> list[Target]:
    """Return the ships of the field, and the decoy behind them if there is one."""
    several = [{name: ships[name][k] for name in ships} for k in range(len(ships["fraction"]))]
    if decoy["fraction"].any():
        several.append(decoy)
    return [Target.of(one, bins) for one in several]


SETTINGS: tuple[type[Settings], ...] = (Scan,)
STAGES: tuple[Stage, ...] = (*(scan_drawn, scan_bins, scan_field, scan_names, scan_edges),)
