"""Named splits into training and test, each with the question that it asks."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ncti.checks import require, require_word
from ncti.data.rows import NUMBERS, dataset
from ncti.ladar.budget import carrier_to_noise
from ncti.render.flight import DEPRESSION

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

KNOWN_SHIPS = ("duncan", "horne", "spruance", "texas")
"""Ships learned. Duncan is one of two sister ships; each of the others has its own class."""

SISTER, UNRELATED = "roberts", "connole"
"""Ships not learned: Roberts, of Duncan's class with a longer hull, and one of another class."""

TRAIN, TEST, UNKNOWN = "train", "test", "unknown"
TRAINING_ROWS, TEST_ROWS = 1600, 800
SLOW_ROWS = 400  # rows, which take seconds
PER_VIEW = {TRAIN: 8, TEST: 2, UNKNOWN: 2}
"""Rows per view. Test scores vary more between views than between draws of a view."""

ONE_SIDE = (0.0, 180.0)
"""Aspects [deg]: one side of a ship, since the other shows nearly the same profiles."""

SECTOR = 30.0
"""Width of the sector that `aspect-gap` leaves out [deg]."""

NEAR_RANGE, FAR_RANGE = 25e3, 100e3
"""Slant ranges [m] of `range-shift`; all other rows are at the second."""

FEW_FRAMES = 2
"""Frames averaged in the tests of `few-frames`, an eighth of those learned."""

GAIN_DRIFT, FLOOR_DRIFT, CNR_LOSS = 0.1, 0.5, 3.0
"""Drift of the radar in `sensor-shift`, assumed: standard deviations of the gain (0.8 dB of power)
and of the floor, in rms deviations of a frame; and loss of carrier-to-noise ratio [dB]."""

VARIANTS = 12
"""Variants of a ship in `variant`, half of them learned."""

SPLITS = {
    "aspect-random": "Are ships named at aspects between those learned?",
    "aspect-gap": "Are they named in a sector of 30 degrees that was never seen?",
    "range-shift": "Does what was learned at 25 km hold at 100 km?",
    "sensor-shift": "Does it hold for a radar whose gain, noise floor and carrier have drifted?",
    "variant": "Are ships named that differ from those learned as ships of a class may?",
    "unknown-near": "Is a sister ship that was not learned told from the ships learned?",
    "unknown-far": "Is a ship of another class that was not learned told from them?",
    "few-frames": "What is left when two frames are averaged instead of 16?",
}
"""Question of each split, by its name."""

Rows = dict[str, Any]

NOMINAL: Rows = {
    "aspect": ONE_SIDE,
    "depression": DEPRESSION,
    "slant_range": FAR_RANGE,
    "pulse_width": 30e-9,
    "frames": 16,
    "gain": 1.0,
    "floor": 0.0,
}
"""Parameters of all rows, unless a split changes them."""


@dataclass(frozen=True, eq=False)
class Split:
    """Rows of training and test, which share no view, noise or variant.

    Attributes
    ----------
    name, question : str
        One of `SPLITS`.
    seed : int
        Seed that determines all rows.
    train, test : xarray.Dataset
        Rows of `ncti.dataset`; `ship` is the right answer, and `variant` the ship drawn. Those
        of training have their expected profiles, too.
    unknown : xarray.Dataset or None
        Rows of a ship that is absent from training, to be rejected.

    See Also
    --------
    split : Makes it.

    Examples
    --------
    >>> import ncti
    >>> halves = ncti.data.split("few-frames", seed=0, train=16, test=4)
    >>> halves.train.sizes["row"], halves.test.frames.values.tolist(), halves.unknown
    (16, [2, 2, 2, 2], None)
    """

    name: str
    question: str
    seed: int
    train: xr.Dataset
    test: xr.Dataset
    unknown: xr.Dataset | None

    def to_pandas(self) -> pd.DataFrame:
        """Return rows, views, ships and the aspects [deg] of each part, one row a part."""
        import pandas as pd

        summary = {
            name: {
                "rows": part.sizes["row"],
                "views": len(np.unique(part.view)),
                "ships": ", ".join(np.unique(part.ship)),
                "aspects": f"{float(part.aspect.min()):.0f}-{float(part.aspect.max()):.0f}",
            }
            for name, part in parts_of(self).items()
        }
        return pd.DataFrame.from_dict(summary, orient="index")

    def _repr_html_(self) -> str:
        return f"<p>{self.name}, seed {self.seed}: {self.question}</p>{self.to_pandas().to_html()}"


def parts_of(split: Split) -> dict[str, xr.Dataset]:
    """Return the parts of a split by name."""
    parts = {TRAIN: split.train, TEST: split.test, UNKNOWN: split.unknown}
    return {name: rows for name, rows in parts.items() if rows is not None}


def split(
    name: str,
    *,
    seed: int,
    ships: Sequence[str] = KNOWN_SHIPS,
    train: int = TRAINING_ROWS,
    test: int = TEST_ROWS,
    workers: int = 1,
) -> Split:
    """Return the rows of a named split, whose test shares nothing with its training.

    Parameters
    ----------
    name : str
        One of `ncti.data.SPLITS`, which has the question of each.
    seed : int
        Seed. Training and test use different seeds derived from it, so that no draw of noise, view
        or variant is in both.
    ships : sequence of str
        Names of the ships that are learned.
    train, test : int
        Number of rows: eight of a view in training, two in a test. An unknown ship has half as many
        rows as the test.
    workers : int
        Processes, as of `ncti.dataset`.

    Returns
    -------
    Split

    Raises
    ------
    ValueError
        If there is no such split, a ship does not exist or is one that tests must reject, or a
        number is out of range.

    See Also
    --------
    ncti.dataset : Makes rows.
    card : Description of a split for machines.
    ncti.evaluate.score : Scores of the answers.

    Notes
    -----
    Aspects are of one side of a ship: its other side shows nearly the same, and would leak. For one
    seed, all splits except `aspect-gap`, `range-shift` and `variant` share their training, and all
    tests at random aspects share views and noise, so that splits differ only in their conditions.
    The sector of `aspect-gap` is the sixth of the side whose number is the seed modulo 6. The drift
    of `sensor-shift` is drawn for each row: gain and floor of normal distributions, the
    carrier-to-noise ratio 3 dB less.

    Examples
    --------
    >>> import ncti
    >>> halves = ncti.data.split("aspect-gap", seed=1, train=80, test=8)
    >>> bool(((halves.test.aspect >= 30) & (halves.test.aspect < 60)).all())
    True
    >>> bool(((halves.train.aspect < 30) | (halves.train.aspect >= 60)).all())
    True
    """
    for part, count in ((TRAIN, train), (TEST, test)):
        require(part, count, **vars(NUMBERS["count"]))
    counts = {TRAIN: train, TEST: test, UNKNOWN: max(test // 2, 1)}
    if train + test > SLOW_ROWS:
        message = "simulating %d rows to learn and %d to test; this takes some seconds"
        logging.getLogger("ncti").warning(message, train, test)
    rows = {
        part: rows_of(name, part, seed=seed, ships=ships, count=count, workers=workers)
        for part, count in counts.items()
        if part != UNKNOWN or name in OUTSIDERS
    }
    return Split(name, SPLITS[name], seed, rows[TRAIN], rows[TEST], rows.get(UNKNOWN))


def rows_of(
    name: str, part: str, *, seed: int, ships: Sequence[str], count: int, workers: int = 1
) -> xr.Dataset:
    """Return the rows of one part, "train", "test" or "unknown", of a split; see `Split`."""
    names, arguments = recipe(name, part, seed=seed, ships=ships)
    rows = dataset(names, count, workers=workers, expected=part == TRAIN, **arguments)
    base = np.array([ship.partition("@")[0] for ship in rows.ship.values.tolist()])
    attributes = {"long_name": "ship drawn, a variant of the ship to be named"}
    return rows.assign_coords(
        variant=("row", rows.ship.values, attributes), ship=("row", base, rows.ship.attrs)
    )


def recipe(name: str, part: str, *, seed: int, ships: Sequence[str]) -> tuple[list[str], Rows]:
    """Return the ships of one part of a split, and arguments of `ncti.dataset` for its rows."""
    require_word("name", name, SPLITS)
    require_word("part", part, PER_VIEW)
    require("seed", seed, minimum=0, maximum=2**63 - 1, whole=True)
    if isinstance(ships, str) or len(ships) < 2 or {SISTER, UNRELATED} & {*ships}:
        raise ValueError(
            f"ships is {ships!r:.60}, but must be at least two ships without {SISTER} and "
            f"{UNRELATED}, which are unknown"
        )
    arguments = NOMINAL | _changed_parameters(name, part, seed)
    arguments |= {"seed": _row_seed(name, part, seed), "rows_per_view": PER_VIEW[part]}
    return _ships(name, part, seed, ships), arguments


def same_training_split(name: str) -> str:
    """Return the first split with the same training as another."""
    return name if name in ("aspect-gap", "range-shift", "variant") else "aspect-random"


OUTSIDERS = {"unknown-near": SISTER, "unknown-far": UNRELATED}


def gap(seed: int) -> tuple[float, float]:
    """Return the sector [deg] that `aspect-gap` leaves out for a seed, lower end inclusive."""
    low = SECTOR * (seed % round(ONE_SIDE[1] / SECTOR))
    return low, low + SECTOR


def _row_seed(name: str, part: str, seed: int) -> int:
    """Return the seed of the rows of a part.

    Parts share it only if they have the same training, or the same views and noise under other
    conditions.
    """
    training = [*SPLITS].index(same_training_split(name))
    key = {TRAIN: (0, training), TEST: (1, 0), UNKNOWN: (2, [*SPLITS].index(name))}[part]
    words = np.random.SeedSequence(seed, spawn_key=key).generate_state(1, np.uint64)
    return int(words[0] >> np.uint64(1))


def _ships(name: str, part: str, seed: int, ships: Sequence[str]) -> list[str]:
    """Return the names of a part's ships, of variants in the split `variant`."""
    if part == UNKNOWN:
        return [OUTSIDERS[name]]
    if name != "variant":
        return list(ships)
    order = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,)))
    numbers = 1 + order.permutation(VARIANTS)
    half = numbers[: VARIANTS // 2] if part == TRAIN else numbers[VARIANTS // 2 :]
    return [f"{ship}@0.{number}" for ship in ships for number in sorted(half.tolist())]


def _changed_parameters(name: str, part: str, seed: int) -> Rows:
    """Return the parameters of a part that differ from the nominal ones."""
    from scipy.stats import norm, rv_histogram

    changes: Rows = {}
    if name == "aspect-gap":
        low, high = gap(seed)
        edges = sorted({ONE_SIDE[0], low, high, ONE_SIDE[1]})
        weights = [0.0 if start == low else end - start for start, end in pairwise(edges)]
        outside = rv_histogram((np.array(weights), np.array(edges)), density=False)
        changes["aspect"] = outside if part == TRAIN else (low, high)
    elif name == "range-shift" and part == TRAIN:
        changes["slant_range"] = NEAR_RANGE
    elif name == "sensor-shift" and part != TRAIN:
        nominal = 10 * math.log10(carrier_to_noise(FAR_RANGE))
        changes |= {"gain": norm(1, GAIN_DRIFT), "floor": norm(0, FLOOR_DRIFT)}
        changes["cnr"] = nominal - CNR_LOSS
    elif name == "few-frames" and part != TRAIN:
        changes["frames"] = FEW_FRAMES
    return changes
