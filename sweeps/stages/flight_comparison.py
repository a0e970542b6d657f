"""Measured profiles held against those without noise: how alike they are, and their landmarks."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.irar import Landmarks, landmarks, profile_correlation

Floats = NDArray[np.float64]

SOURCES = ("measured", "noiseless", "synthetic", "point")
STERN, NEAR_STERN = 180.0, 15.0  # deg: landmarks are told within so much of it
HANGAR = 4.0  # m either side of its spike, without which profiles are correlated, too
HANGAR_REACH = 8.0  # m either side of where a spike must be to be the hangar's

HANGARS = {"connole": (-40.0, -20.0)}
"""Where near-stern profiles have a hangar that is not their highest peak [m]: her stack returns
more."""

PERRY = ("duncan", "roberts")
"""Ships whose masts and bridge are where landmarks are looked for; of others they are not told."""

ENDS = {"measured": 0.02, "noiseless": 0.02, "synthetic": 0.05, "point": 0.05}
"""Share of the highest peak at which a ship begins: a bare deck returns 0.02, which is all that is
there where a transom is dark; pixels of a level lattice spread as much beyond a sloping stern."""

LANDMARKS = {  # label and unit
    "stern_to_hangar": ("from the stern end to the hangar's spike", "m"),
    "stern_to_bridge": ("from the stern end to the front of the forward structure", "m"),
    "transom_ratio": ("height of the highest within 5 m of the stern over the hangar's", "1"),
    "mast_position": ("main mast, past the hangar", "m"),
    "mast_ratio": ("height of the main mast's peak over the hangar's", "1"),
    "forward_position": ("peak of the forward block, past the hangar", "m"),
    "forward_ratio": ("height of the forward block's peak over the hangar's", "1"),
    "transom_energy": ("returns within 1.5 m of the transom's peak over the hangar's", "1"),
    "mast_energy": ("returns within 1.5 m of the main mast's peak over the hangar's", "1"),
    "forward_energy": ("returns within 1.5 m of the forward peak over the hangar's", "1"),
    "deck_spikes": ("peaks between the transom and the hangar", "1"),
}


def compared(
    profiles: Floats, down_range: Floats, *, aspect: float, ship: str = ""
) -> dict[str, NDArray[Any]]:
    """Return how alike profiles are, and their landmarks.

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
    measured, noiseless, synthetic = profiles[:3]
    astern = abs(aspect - STERN) <= NEAR_STERN
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
    told = [_figures(marks, ship in PERRY) for marks in found]
    offset = [math.nan if marks is None else marks.hangar for marks in found[:2]]
    return {
        "profile_correlation": np.array(profile_correlation(measured, noiseless)),
        "profile_correlation_without_hangar": np.array(
            profile_correlation(measured, noiseless, exclude=without)
        ),
        "hangar_spike_offset": np.array(offset[0] - offset[1]),
        **{name: np.array([one.get(name, math.nan) for one in told]) for name in LANDMARKS},
    }


def _figures(marks: Landmarks | None, perry: bool) -> dict[str, float]:
    """Landmarks of one profile by name."""
    if marks is None:
        return {}
    figures = {
        "stern_to_hangar": marks.stern,
        "stern_to_bridge": marks.stern_to_bridge,
        "transom_ratio": marks.transom.height,
        "transom_energy": marks.transom.energy,
        "deck_spikes": float(len(marks.deck_spikes)),
    }
    for name, peak in (("mast", marks.mast), ("forward", marks.forward)) if perry else ():
        figures[f"{name}_position"] = peak.offset
        figures[f"{name}_ratio"] = peak.height
        figures[f"{name}_energy"] = peak.energy
    return figures
