"""Measured profiles held against those without noise: how alike they are, and their landmarks."""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from ncti.irar import Landmarks, landmarks, profile_correlation
from sweeps.cache import Arrays
from sweeps.flight_variables import SOURCES

STERN, NEAR_STERN = 180.0, 15.0  # deg: landmarks are told within so much of it
HANGAR = 4.0  # m either side of its spike, without which profiles are correlated, too
HANGAR_REACH = 8.0  # m either side of where a spike must be to be the hangar's

Floats = NDArray[np.float64]

HANGARS = {"connole": (-40.0, -20.0)}
"""Where near-stern profiles have a hangar that is not their highest peak [m]: her stack returns
more."""

PERRY = ("duncan", "roberts")
"""Ships whose masts and bridge are where landmarks are looked for; of others they are not told."""

ENDS = {"measured": 0.02, "noiseless": 0.02, "synthetic": 0.05, "point": 0.05}
"""Share of the highest peak at which a ship begins: a bare deck returns 0.02, which is all that is
there where a transom is dark; pixels of a level lattice spread as much beyond a sloping stern."""


def compared(profiles: Floats, down_range: Floats, *, aspect: float, ship: str = "") -> Arrays:
    """How alike profiles are, and their landmarks.

    Parameters
    ----------
    profiles : (source, bin) float64 ndarray
        Of the sources in their order.
    down_range : (bin,) float64 ndarray
        Centres of the bins [m].
    aspect : float
        Of the ship [deg].
    ship : str
        Its name.

    Returns
    -------
    dict of str to ndarray
        profile_correlation, profile_correlation_without_hangar, hangar_spike_offset : ();
        landmarks : (source,), NaN where the view is not near the stern or has none.

    Notes
    -----
    The hangar's spike is the highest of the synthetic profile, in which nothing glints, or the
    highest where `HANGARS` has it, and in the others what is highest close to it. Masts and bridge
    are looked for where the Perry class has them, and told of its ships alone.
    """
    by_source = dict(zip(SOURCES, profiles, strict=True))
    measured, noiseless = by_source["measured"], by_source["noiseless"]
    astern, synthetic = abs(aspect - STERN) <= NEAR_STERN, by_source["synthetic"]
    if astern and ship in HANGARS:
        first, last = HANGARS[ship]
        synthetic = np.where((down_range >= first) & (down_range <= last), synthetic, 0)
    spike = float(down_range[synthetic.argmax()])
    without = np.abs(down_range - spike) <= HANGAR
    found: list[Landmarks | None] = [None] * len(SOURCES)
    if astern:
        near = (spike - HANGAR_REACH, spike + HANGAR_REACH)
        for k, line in enumerate(profiles):
            with suppress(ValueError):  # nothing returns there
                found[k] = landmarks(line, down_range, hangar=near, end=ENDS[SOURCES[k]])
    table = np.array([_figures(marks) for marks in found], dtype=np.float32).T
    if ship not in PERRY:
        table[[_FIGURES.index(name) for name in OF_PERRY]] = np.nan
    offset = [math.nan if marks is None else marks.hangar for marks in found[:2]]
    return {
        "profile_correlation": profile_correlation(measured, noiseless),
        "profile_correlation_without_hangar": profile_correlation(
            measured, noiseless, exclude=without
        ),
        "hangar_spike_offset": np.array(offset[0] - offset[1]),
        **dict(zip(_FIGURES, table, strict=True)),
    }


_FIGURES = (
    *("stern_to_hangar", "stern_to_bridge", "transom_ratio", "transom_energy"),
    *("mast_position", "mast_ratio", "mast_energy"),
    *("forward_position", "forward_ratio", "forward_energy", "deck_spikes"),
)


OF_PERRY = tuple(name for name in _FIGURES if name.startswith(("mast", "forward")))


def _figures(marks: Landmarks | None) -> tuple[float, ...]:
    if marks is None:
        return (math.nan,) * len(_FIGURES)
    return (
        *(marks.stern, marks.stern_to_bridge, marks.transom.height, marks.transom.energy),
        *(marks.mast.offset, marks.mast.height, marks.mast.energy),
        *(marks.forward.offset, marks.forward.height, marks.forward.energy),
        float(len(marks.deck_spikes)),
    )
