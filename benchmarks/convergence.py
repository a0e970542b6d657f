"""Effect of gain annealing on the training of the multilayered network, on the article's task."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from itertools import product

from sklearn.exceptions import ConvergenceWarning
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # of scikit-learn

from benchmarks.classifiers import Task, clocked, percent, source_task
from benchmarks.reports import Column, Report, Sample
from ncti.classify import GainAnnealedNetwork

STATES = 5  # random states
RATES = (0.005, 0.015, 0.05, 0.15)
EPOCHS = (50, 100, 200, 400, 800)
LONGEST = 3000  # epochs, for networks that are to meet the tolerance
NEVER = 1e-9  # a tolerance that is not met

WAYS = (True, False)
"""With annealing and without."""


def measure(
    *, repeats: int, task: Task | None = None, states: int = STATES, rates: Sequence[float] = RATES
) -> Report:
    """Epochs and time to the tolerance, with annealing and without, at several learning rates.

    Parameters
    ----------
    repeats : int
        How often every network is trained.
    task : Task, optional
        Profiles; the article's when not given.
    states : int
        Random states, each of a network.
    rates : sequence of float
        Learning rates.

    Returns
    -------
    Report
        One row per learning rate and way.
    """
    task = source_task() if task is None else task
    rows = []
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        for rate in rates:
            seconds: dict[bool, list[float]] = {way: [] for way in WAYS}
            networks: dict[bool, list[GainAnnealedNetwork]] = {way: [] for way in WAYS}
            for turn, state in product(range(repeats + 1), range(states)):
                # With annealing first, then without: neither always follows the other.
                for way in WAYS[:: 1 if (turn + state) % 2 == 0 else -1]:
                    network = GainAnnealedNetwork(
                        annealing=way, learning_rate=rate, epochs=LONGEST, random_state=state
                    )
                    taken, _ = clocked(network.fit, task.training, task.label)
                    if turn:  # the first one is not counted
                        seconds[way].append(taken)
                    else:
                        networks[way].append(network)
            for way in WAYS:
                found = networks[way]
                pairs = zip(seconds[way], seconds[False], strict=True)
                rows.append(
                    {
                        "learning_rate": rate,
                        "annealing": "yes" if way else "no",
                        "met": sum(network.converged_ for network in found),
                        "epochs": Sample.of(network.n_iter_ for network in found),
                        "ms": Sample.of(1e3 * value for value in seconds[way]),
                        "ratio": Sample.of(mine / plain for mine, plain in pairs).median,
                        "right_percent": Sample.of(
                            percent(network.predict(task.tests), task.true_label)
                            for network in found
                        ),
                    }
                )
    tolerance = GainAnnealedNetwork().tolerance
    return Report(
        f"Training to a root mean square error of {tolerance:g}, {states} random states, "
        f"{repeats} times",
        (
            Column("learning_rate", "rate", "g"),
            Column("annealing", "annealed"),
            Column("met", "met", "d"),
            Column("epochs", "epochs", ".0f"),
            Column("ms", "ms", ".0f"),
            Column("ratio", "x as long", ".2f"),
            Column("right_percent", "right [%]", ".1f"),
        ),
        rows,
        [
            "On one core, median (lowest–highest), after one round that is not counted. Met: of "
            f"the random states, those there within {LONGEST} epochs. As long: as the same state "
            "without annealing, next to it.",
            "Right: ship and aspect group, of the averages that `classifier_times` has.",
        ],
    )


def measure_course(
    *,
    task: Task | None = None,
    states: int = STATES,
    epochs: Sequence[int] = EPOCHS,
) -> Report:
    """Error and answers after several numbers of epochs, with annealing and without.

    Parameters
    ----------
    task : Task, optional
        Profiles; the article's when not given.
    states : int
        Random states, each of a network.
    epochs : sequence of int
        Numbers of epochs.

    Returns
    -------
    Report
        One row per number of epochs and way.
    """
    task = source_task() if task is None else task
    rows = []
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        for count, way in product(epochs, WAYS):
            networks = [
                GainAnnealedNetwork(
                    annealing=way, tolerance=NEVER, epochs=count, random_state=state
                ).fit(task.training, task.label)
                for state in range(states)
            ]
            rows.append(
                {
                    "epochs": count,
                    "annealing": "yes" if way else "no",
                    "error": Sample.of(math.sqrt(network.loss_curve_[-1]) for network in networks),
                    "training_percent": Sample.of(
                        percent(network.predict(task.training), task.label) for network in networks
                    ),
                    "right_percent": Sample.of(
                        percent(network.predict(task.tests), task.true_label)
                        for network in networks
                    ),
                }
            )
    return Report(
        f"Course of the training, learning rate {GainAnnealedNetwork().learning_rate:g}, "
        f"{states} random states",
        (
            Column("epochs", "epochs", "d"),
            Column("annealing", "annealed"),
            Column("error", "error", ".3f"),
            Column("training_percent", "training right [%]", ".1f"),
            Column("right_percent", "right [%]", ".1f"),
        ),
        rows,
        [
            "Median (lowest–highest) of the states. Error: root mean square of all outputs at the "
            "gain of the last epoch; right: ship and aspect group, of the profiles learned and of "
            "the averages."
        ],
    )
