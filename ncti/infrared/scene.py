"""The warm scene before a sensor: its own spread, and detector noise by frame count."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require

# Pixels about the ship that are drawn with it. A super-resolved pixel depends on its neighbours up
# to back_projections + 1 away, so that up to three back-projections see no window.
HALO = 4


def draw_scene(
    target: NDArray[np.bool_],
    *,
    contrast: float,
    frame_counts: Sequence[int] | NDArray[np.integer],
    rng: np.random.Generator,
    nedt: float,
    target_spread: float,
    sea_spread: float,
    rim: int = 0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Temperatures of ship and sea, and the detector noise of the average of some frames.

    Parameters
    ----------
    target : (row, col) bool array_like
        True on the ship.
    contrast : float
        Mean temperature of the ship against the mean sea [K].
    frame_counts : (frame_count,) sequence of int
        Frames averaged, in any order.
    rng : numpy.random.Generator
        Source of randomness.
    nedt : float
        Noise of one frame [K].
    target_spread, sea_spread : float
        Own standard deviation of the ship's and the sea's temperature [K].
    rim : int
        Pixels of sea around the window that are drawn too.

    Returns
    -------
    scene : (row + 2 rim, col + 2 rim) float64 ndarray
        Temperature against the mean sea, the same in every frame [K].
    noise : (frame_count, row + 2 rim, col + 2 rim) float64 ndarray
        Detector noise of each average, in the order of `frame_counts` [K].

    Raises
    ------
    ValueError
        If a parameter is out of range or the target is not an image.

    Notes
    -----
    Article, Appendix 2: a Gaussian temperature for the ship and one for the sea in every pixel,
    of which the template keeps one. So one normal a pixel is enough: the other of the pair is
    never seen. The article's deviations contain the noise of the 16-frame average; here noise and
    own spread are apart, because only the noise falls with the number of frames.

    The averages are over prefixes of the same frames. The sum of N_k frames is a random walk over
    k with steps of variance N_k - N_(k-1), drawn as such at a cost free of the number of frames. So
    another set of frame counts gives other noise from the same generator, of the same distribution,
    and another sea beyond the rim of the ship; the ship itself stays.

    Order of the draws: the ship's bounding box with a rim of `HALO` pixels, whether the window
    holds them or not; the rest of the window; the rest of the rim. In each of them first the scene
    and then the frame counts, ascending, each row by row. A larger window so changes no bit on the
    ship, and a rim none in the window.
    """
    target = np.asarray(target, dtype=bool)
    if target.ndim != 2:
        raise ValueError(f"target has {target.ndim} axes, but must have a row and a column axis")
    require("contrast", contrast)
    require("nedt", nedt, minimum=0.0)
    require("target_spread", target_spread, minimum=0.0)
    require("sea_spread", sea_spread, minimum=0.0)
    if np.size(frame_counts) == 0:
        raise ValueError("frame_counts is empty, but must hold at least one number")
    for count in np.ravel(frame_counts):
        require("frame_counts", count, minimum=1.0)
        if count != int(count):
            raise ValueError(f"frame_counts is {count!r}, but must be whole numbers")

    wanted = [int(count) for count in np.ravel(frame_counts)]
    counts = sorted(set(wanted))
    normals = _draw(target, 1 + len(counts), rim, rng)
    scene = normals[0]
    if target_spread == sea_spread:
        scene *= sea_spread
    else:
        scene *= np.where(np.pad(target, rim), target_spread, sea_spread)
    rows, cols = target.shape
    scene[rim : rim + rows, rim : rim + cols] += contrast * target
    walk = normals[1:]
    walk[0] *= math.sqrt(counts[0])
    for k, (before, after) in enumerate(pairwise(counts), start=1):
        walk[k] *= math.sqrt(after - before)
        walk[k] += walk[k - 1]
    noise = walk[[counts.index(count) for count in wanted]] if wanted != counts else walk
    noise *= (nedt / np.array(wanted))[:, None, None]
    return scene, noise


def _draw(
    target: NDArray[np.bool_], count: int, rim: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Standard normals (count, row + 2 rim, col + 2 rim) in the order that `draw_scene` tells."""
    shape = target.shape[0] + 2 * rim, target.shape[1] + 2 * rim
    normals = np.empty((count, *shape))
    undrawn = np.ones(shape, bool)
    if target.any():
        begin, end = zip(*(_span(lines) for lines in (target, target.T)), strict=True)
        box = rng.standard_normal(
            (count, end[0] - begin[0] + 2 * HALO, end[1] - begin[1] + 2 * HALO)
        )
        corner = tuple(first - HALO + rim for first in begin)
        here = tuple(
            slice(max(0, first), min(size, first + drawn))
            for first, size, drawn in zip(corner, shape, box.shape[1:], strict=True)
        )
        there = tuple(
            slice(part.start - first, part.stop - first)
            for part, first in zip(here, corner, strict=True)
        )
        normals[(slice(None), *here)] = box[(slice(None), *there)]
        undrawn[here] = False
    inside = np.zeros(shape, bool)
    inside[rim : rim + target.shape[0], rim : rim + target.shape[1]] = True
    for part in (undrawn & inside, undrawn & ~inside):
        places = np.flatnonzero(part)
        if places.size:
            normals.reshape(count, -1)[:, places] = rng.standard_normal((count, places.size))
    return normals


def _span(lines: NDArray[np.bool_]) -> tuple[int, int]:
    """First row that holds something true, and the one past the last."""
    at = np.flatnonzero(lines.any(axis=1))
    return int(at[0]), int(at[-1]) + 1
