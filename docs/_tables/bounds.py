"""Percent correct of the likelihood classifier by its assumed knowledge."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.reports import Column, Report
from docs._tables.repeated import list_argument, mean_over_seeds, percent_of
from docs._tables.sweeping import WORKERS, sweep_groups
from sweeps.engine.run.cluster import ClusterChoice

STEP, LAST_ASPECT, DRAWS = 3.0, 90.0, 10
COMMON = ("classifier=likelihood", "render.engine=lines", "classifier.gain_sigma=[0,1]")
FRAMES = (4, 8, 16)
FLOORS = {  # settings by what is known of the floor
    "known": "classifier.floor_sigma=0",
    "unknown": "classifier.floor_sigma=1",
    "estimated": "classifier.floor_sigma=0 classifier.floor_estimated=true",
}
GROUP = "classification/likelihood"


def measure(
    draws: int = DRAWS,
    last: float = LAST_ASPECT,
    frames: Sequence[int] = FRAMES,
    more: Sequence[str] = (),
    workers: ClusterChoice = WORKERS,
) -> Report:
    """Return percent correct half-way between learned aspects, by known parameters.

    Parameters
    ----------
    draws : int
        Draws of the noise.
    last : float
        Last learned aspect [deg].
    frames : sequence of int
        Numbers of frames averaged.
    more : sequence of str
        Arguments of `ncti-sweep` that are added.
    workers : ClusterChoice
        Where cells are computed.
    """
    learned = np.arange(0.0, last + 0.1, STEP)
    between = learned[:-1] + STEP / 2
    of_aspect = {
        "known": (
            f"grid.aspect={list_argument(between.tolist())}",
            *("classifier.aspect_sigma=0", "classifier.template_error=0"),
        ),
        "unknown": (
            f"grid.aspect={list_argument(sorted([*learned, *between]))}",
            f"classifier.training_aspect={list_argument(learned.tolist())}",
        ),
    }
    rows = []
    drawn = (f"grid.frame_count={list_argument(frames)}", f"grid.replicate={draws}")
    for aspect, chosen in of_aspect.items():
        for floor, settings in FLOORS.items():
            args = [*COMMON, *drawn, *chosen, *settings.split(), *more]
            label = f"aspect {aspect}, floor {floor}"
            correct = sweep_groups(args, [GROUP], label=label, workers=workers)[
                GROUP
            ].correct.squeeze(drop=True)
            new = np.isin(correct.aspect.values, between)
            for gain, sigma in (("known", 0), ("unknown", 1)):
                row = {"aspect": aspect, "floor": floor, "gain": gain}
                for count in frames:
                    answers = correct.sel(gain_sigma=sigma, frame_count=count)
                    shares = [percent_of(answers.isel(replicate=k), new) for k in range(draws)]
                    row[str(count)] = mean_over_seeds(shares, views=4 * between.size).text()
                rows.append(row)
    heads = [Column(name, name) for name in ("aspect", "floor", "gain")]
    counts = [Column(str(count), f"{count} frames") for count in frames]
    return Report(
        "Percent correct of the likelihood classifier, by what it takes as known",
        (*heads, *counts),
        rows,
        [
            f"Percent correct at 100 km, 30 ns, four ships learned every {STEP:g}° and tested "
            f"half-way between: means over {draws} draws of the noise, with their 95 % intervals."
        ],
    )
