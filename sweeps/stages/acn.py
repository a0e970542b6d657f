"""The Adaptive Clustering Network, trained on what is noiseless and tested on averages of frames.

Of the laser radar these are range profiles, presented in the grid's own order; of the infrared
imager silhouettes, presented in several orders. The map of an empty silhouette is zero everywhere,
matches no category and so names no ship, which counts as wrong.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.evaluate import wilson_interval
from sweeps.engine.run_settings import Run
from sweeps.engine.settings import Choices, Setting, Settings
from sweeps.engine.stage import Output, Stage, in_memory, plain, stage
from sweeps.stages.categories import (
    Lessons,
    Network,
    answer_tests,
    form_categories,
    name_categories,
)
from sweeps.stages.classifier import (
    GATHERED,
    OF_PROFILES,
    VIEW,
    Views,
    answers,
    known_ships,
    map_vectors,
    names_by,
    profile_vectors,
    tables_of,
)
from sweeps.stages.images import LOOK
from sweeps.stages.infrared import Infrared
from sweeps.stages.scores import data_set, formed, scored
from sweeps.stages.silhouettes import OF_SILHOUETTES
from sweeps.stages.views import INFRARED, RANGE, Grid

if TYPE_CHECKING:
    import xarray as xr

NAME = "acn"
DRAWS = ("phase", "order")  # what scores of silhouettes are averaged over


@in_memory(gather=GATHERED, keep=4)
def profile_lessons(expected: NDArray[np.float32], there: Views) -> Lessons:
    """Return what all trainings with the same expected profiles share."""
    return Lessons.of(expected, there, profile_vectors)


@in_memory(gather=GATHERED, keep=4)
def silhouette_lessons(template_log_polar: NDArray[np.uint8], there: Views) -> Lessons:
    """Return what all trainings with the same silhouettes share."""
    return Lessons.of(template_log_polar, there, map_vectors)


@plain()
def grid_order() -> tuple[int, int]:
    """Return number and seed of the grid's own order of presentation."""
    return 0, 0


@plain(uses=(Infrared, Run))
def drawn_order(orders: int, seed: int) -> tuple[int, int]:
    """Return number and seed of an order of presentation."""
    return orders, seed


def network(
    name: str,
    sensor: str,
    uses: tuple[type[Settings], ...],
    reads: Mapping[str, str],
    along: tuple[Setting, ...],
    trained: tuple[str, ...],
    tested: tuple[str, ...],
    words: tuple[str, str, str, str],
) -> tuple[Stage, ...]:
    """Declare training, naming and tests of one sensor's network.

    Parameters
    ----------
    name, sensor : str
        Name of the stages and their group, and the sensor that must look.
    uses, reads
        Settings, and the stages that stand for `lessons`, `presentation` and `tests`.
    along : tuple of Setting
        Axes that tests compute together, the vigilance and the number of frames last of them.
    trained, tested : tuple of str
        Dimensions of trainings, and further ones of tests.
    words : tuple of str
        What is learned, and tested; what the states are of, and the group that they are in.
    """
    learned, shown, cells, states = words
    group = f"classification/{name}"
    when = names_by(NAME, sensor)
    neither_rule = ("label_rule", "score_rule")
    training = stage(
        Output("training_category", VIEW, "i4", label=f"category of the {learned}"),
        Output(
            "training_confused",
            VIEW,
            "i1",
            label="1 where views of another ship share that category",
        ),
        Output(
            "passes",
            dtype="i4",
            fill=0,
            label="presentations until the categories settled, negative if they did not",
        ),
        Output("weights", ("category", "view"), "f8", stored=False),
        Output("turn", ("view",), "i8", stored=False),
        uses=(*uses, Network),
        reads=reads,
        group=group,
        dims=trained,
        when=when,
        status="-",
        name=f"{name}_training",
    )
    names = stage(
        Output("training_correct", VIEW, "i1", label="1 where that category has the ship's name"),
        Output("names", ("category",), "i2", stored=False),
        uses=(Network,),
        reads={"training": f"{name}_training"},
        group=group,
        dims=(*trained, "label_rule"),
        when=when,
        status="-",
        name=f"{name}_names",
    )
    tests = stage(
        Output(
            "category",
            VIEW,
            "i4",
            label=f"category that the {shown} falls into",
            without=neither_rule,
        ),
        Output("similarity", VIEW, label="cosine to that category", without=neither_rule),
        *answers(cells, states, without=("score_rule",)),
        uses=(*uses, Network),
        reads={**reads, "training": f"{name}_training", "names": f"{name}_names"},
        along=(*along, Network.label_rule, Network.score_rule),
        gather=GATHERED,
        group=group,
        dims=(*trained, "label_rule", "score_rule", *tested),
        when=when,
        status="-",
        name=name,
    )
    return training(form_categories), names(name_categories), tests(answer_tests)


OF_RANGE = network(
    NAME,
    RANGE,
    uses=(Grid,),
    reads={"lessons": "profile_lessons", "presentation": "grid_order", "tests": "averaged"},
    along=(Grid.vigilance, Grid.frame_count),
    trained=(*OF_PROFILES, "learning_rate", "vigilance"),
    tested=("replicate", "frame_count"),
    words=("expected profile", "averaged profile", "the grid", "status"),
)
OF_INFRARED = network(
    "acn_infrared",
    INFRARED,
    uses=(Infrared,),
    reads={"lessons": "silhouette_lessons", "presentation": "drawn_order", "tests": "log_polar"},
    along=(Infrared.orders, Infrared.vigilance, Infrared.frame_count),
    trained=(*OF_SILHOUETTES, *DRAWS, "learning_rate", "vigilance"),
    tested=LOOK,
    words=("noiseless silhouette", "silhouette", "the infrared channel", "status_infrared"),
)


def tabulate_silhouettes(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Tabulate the answers about silhouettes, averaged over phases and orders.

    Returns
    -------
    xarray.Dataset
        As of `sweeps.stages.classifier.tabulate_answers`. Accuracies are means over the phases and
        orders that have answers, with `..._spread`, their standard deviation; both are NaN where
        none has. Intervals are those of the mean for `..._n` answers, the views of one phase and
        order: all of them see the same views, and more looks at a view are no more views.
    """
    known = known_ships(classified, choices)
    tables = formed(known, "training silhouettes")
    for prefix in ("training_", ""):
        what = f"{prefix or 'test_'}silhouettes".replace("_", " ")
        found = scored(known[prefix + "correct"], prefix, what)
        fraction, said = found[prefix + "accuracy"]
        # A training that failed has no answers, and any other has those of all views there are.
        n = found[prefix + "n"][0].max(DRAWS)
        mean = fraction.mean(DRAWS)
        spread = f"standard deviation of that fraction over {' and '.join(DRAWS)}"
        low, high = wilson_interval((mean.fillna(0) * n).clip(0, n), n)
        tables |= {
            prefix + "accuracy": (mean, f"mean {said}"),
            prefix + "spread": (fraction.std(DRAWS), spread),
            prefix + "ci_low": (mean.copy(data=low), found[prefix + "ci_low"][1]),
            prefix + "ci_high": (mean.copy(data=high), found[prefix + "ci_high"][1]),
            prefix + "n": (n, found[prefix + "n"][1]),
        }
    return data_set(tables, known.aspect)


SETTINGS: tuple[type[Settings], ...] = (Network,)
STAGES: tuple[Stage, ...] = (
    *(profile_lessons, silhouette_lessons, grid_order, drawn_order),
    *(*OF_RANGE, *OF_INFRARED),
)
TABLES = (
    *tables_of(NAME, names_by(NAME, RANGE), rejecting=True),
    *tables_of("acn_infrared", names_by(NAME, INFRARED), tabulate_silhouettes, rejecting=True),
)
