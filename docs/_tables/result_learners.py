"""Table of the multilayered network, and of a random forest of raw averages, at new aspects."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from benchmarks.reports import Column, Report
from docs._tables.repeated import bins_of, mean_over_seeds, multiples_mask, percent_of
from docs._tables.result_tables import STEP, Answers

TREES = 300


def learners(by_seed: Answers) -> dict[str, Report]:
    """Return the table of the multilayered network, and of a random forest of raw averages."""
    names = ("0-30°", "30-60°", "60-90°", "overall")
    shares: dict[str, list[dict[str, float]]] = {
        "MNN, ship and aspect group": [],
        "MNN, ship alone": [],
        "random forest of raw averages, which show gain and floor": [],
    }
    for seed, groups in enumerate(by_seed):
        answers = groups["classification/mnn"]
        new = ~multiples_mask(answers.aspect.values, STEP)
        bins = {name: mask & new for name, mask in bins_of(answers.aspect.values).items()}
        forest = forest_answers(groups["range_profile"].averaged, learned=~new, seed=seed)
        for rows, correct in zip(
            shares.values(), (answers.correct, answers.ship_correct, forest), strict=True
        ):
            rows.append({name: percent_of(correct, bins[name]) for name in names})
    title = f"percent correct at 100 km, mean of {len(by_seed)} seeds [95 % interval]"
    return {
        "learners": Report(
            "Other learners at new aspects",
            (Column("what", title), *(Column(name, name) for name in names)),
            [
                {"what": label}
                | {name: mean_over_seeds([row[name] for row in rows]).text() for name in names}
                for label, rows in shares.items()
            ],
        )
    }


def forest_answers(
    averaged: xr.DataArray, *, learned: NDArray[np.bool_], seed: int
) -> xr.DataArray:
    """Return (replicate, ship, aspect) answers, 1 where right, of a random forest.

    It learns the raw averages of all draws of the noise at some aspects; answers there
    are -1.
    """
    from sklearn.ensemble import RandomForestClassifier

    views = ("replicate", "ship", "aspect")
    inputs = averaged.squeeze(drop=True).transpose(*views, "down_range")
    ship = np.broadcast_to(np.arange(inputs.sizes["ship"])[:, None], inputs.shape[:-1])
    forest = RandomForestClassifier(TREES, random_state=seed)
    forest.fit(
        inputs.values[:, :, learned].reshape(-1, inputs.shape[-1]), ship[..., learned].ravel()
    )
    answers = inputs.isel(down_range=0, drop=True).astype(np.float64)
    answers[:] = -1.0
    tests = inputs.values[:, :, ~learned]
    predicted = forest.predict(tests.reshape(-1, tests.shape[-1])).reshape(tests.shape[:-1])
    answers.values[:, :, ~learned] = predicted == ship[..., ~learned]
    return answers
