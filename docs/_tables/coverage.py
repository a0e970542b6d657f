"""Coverage of the intervals of published means, by repeats with other aspects and noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.reports import Column, Report
from docs._tables.repeated import Interval, mean_over_seeds, sweep_by_seed
from docs._tables.result_tables import shares, views_of
from docs._tables.sweeping import WORKERS
from sweeps.engine.run.cluster import ClusterChoice

REPEATS, SEEDS, FRESH_ASPECTS, STEP = 20, 10, 2, 1.5
LAST_ASPECT = 90.0
RANGES = (50, 100)  # km
CLASSIFIERS = ("acn", "correlation", "likelihood")
BINS = ("0-30°", "30-60°", "60-90°", "overall")
SWEEP = (
    *("grid.frame_count=16", f"grid.range=[{','.join(map(str, RANGES))}]", "render.engine=lines"),
    f"classifier.name=[{','.join(CLASSIFIERS)}]",
)


def measure(
    repeats: int = REPEATS,
    seeds: int = SEEDS,
    last: float = LAST_ASPECT,
    more: Sequence[str] = (),
    workers: ClusterChoice = WORKERS,
) -> Report:
    """Return how often the interval of a repeat holds the mean of the others.

    Parameters
    ----------
    repeats, seeds : int
        Repeats of the procedure, each with seeds of its own.
    last : float
        Last learned aspect [deg].
    more : sequence of str
        Arguments of `ncti-sweep` that are added.
    workers : ClusterChoice
        Where cells are computed.
    """
    answers = sweep_by_seed(
        [*SWEEP, *more],
        [f"classification/{name}" for name in CLASSIFIERS],
        seeds=repeats * seeds,
        learned=np.arange(0.0, last + 0.1, STEP).tolist(),
        fresh=FRESH_ASPECTS,
        label="repeats of the procedure",
        workers=workers,
    )
    rows: list[dict[str, Any]] = []
    for km in RANGES:
        for name in CLASSIFIERS:
            group = f"classification/{name}"
            row: dict[str, Any] = {"what": f"{km} km: {name}"}
            for bin_name in BINS:
                percent = np.reshape(
                    shares(answers, group, bin_name, {"range": km}), (repeats, seeds)
                )
                row[bin_name] = 100 * coverage_share(percent, views_of(answers, group, bin_name))
            rows.append(row)
    mean = {bin_name: float(np.mean([row[bin_name] for row in rows])) for bin_name in BINS}
    rows.append({"what": "mean"} | mean)
    return Report(
        "Coverage of 95 % intervals",
        (
            Column("what", f"share of {repeats} repeats [%]"),
            *(Column(bin_name, bin_name, ".0f") for bin_name in BINS),
        ),
        rows,
        [
            f"Each repeat has {seeds} seeds, with {FRESH_ASPECTS} random aspects in every 30° and "
            "draws of place and noise of its own. Its interval should hold the mean of the other "
            "repeats, whose own error is allowed for: 95 % of these do if intervals are right."
        ],
    )


def coverage_share(percent: np.ndarray, views: int) -> float:
    """Return the share of (repeat, seed) percentages whose interval holds the mean of the others.

    The interval is widened by the error of that mean, whose variance is 1 / (repeats - 1) of a
    repeat's.
    """
    wider = np.sqrt(1 + 1 / (len(percent) - 1))
    hits = []
    for k, figures in enumerate(percent):
        interval: Interval = mean_over_seeds(figures, views=views)
        truth = float(np.delete(percent, k, axis=0).mean())
        low = interval.mean - wider * (interval.mean - interval.low)
        high = interval.mean + wider * (interval.high - interval.mean)
        hits.append(low <= truth <= high)
    return float(np.mean(hits))
