"""The Adaptive Clustering Network, trained without noise and tested on averages of frames.

Of the laser radar these are range profiles, of the infrared imager silhouettes, both presented in
one order or several. The map of an empty silhouette is zero everywhere,
matches no category and so names no ship, which counts as wrong.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.settings import Choices, Run, Setting, Settings
from sweeps.engine.stage import Output, Stage, in_memory, plain
from sweeps.stages import categories, classifier
from sweeps.stages.categories import Lessons, Network
from sweeps.stages.classifier import GATHERED, OF_PROFILES, VIEW, Naming, Profiles, Views
from sweeps.stages.infrared import LOOK, Infrared
from sweeps.stages.scores import by_aspects, data_set, formed, scored
from sweeps.stages.silhouettes import OF_SILHOUETTES
from sweeps.stages.views import INFRARED, RANGE, Grid

if TYPE_CHECKING:
    import xarray as xr

NAME = "acn"


@in_memory(gather=GATHERED, keep=4)
def profile_lessons(expected: Profiles, there: Views) -> Lessons:
    """Return the training views and similarities of expected profiles, shared by all trainings."""
    return Lessons.of(expected, there, classifier.profile_vectors)


@in_memory(gather=GATHERED, keep=4)
def silhouette_lessons(template_log_polar: NDArray[np.uint8], there: Views) -> Lessons:
    """Return the training views and similarities of silhouettes, shared by all trainings."""
    return Lessons.of(template_log_polar, there, classifier.map_vectors)


@plain(uses=(Network, Run))
def profile_order(orders: int, seed: int) -> tuple[int, int]:
    """Return the number and seed of an order of presentation; order 0, the grid's own, has none."""
    return orders, seed if orders else 0


silhouette_order = replace(profile_order, name="silhouette_order", uses=(Infrared, Run))


def network(
    naming: Naming,
    reads: dict[str, str],
    along: tuple[Setting, ...],
    trained: tuple[str, ...],
    tested: tuple[str, ...],
    learned: str,
    shown: str,
    uses: tuple[Any, ...],
) -> tuple[Stage, ...]:
    """Declare training, naming and tests of one sensor's network.

    What it reads stands for `lessons`, `presentation` and `tests`; these compute some axes
    together, and have some dimensions besides those of trainings.
    """
    name, rules = naming.name, ("label_rule", "score_rule")
    confused = "1 where views of another ship share that category"
    settled = "presentations until the categories settled, negative if they did not"
    fallen = f"category that the {shown} falls into"
    training = naming.stage(
        Output("training_category", VIEW, "i4", label=f"category of the {learned}"),
        Output("training_confused", VIEW, "i1", label=confused),
        Output("passes", dtype="i4", fill=0, label=settled),
        Output("weights", ("category", "view"), "f8", stored=False),
        Output("turn", ("view",), "i8", stored=False),
        Output("taught_by", ("setting",), "f8", stored=False),
        uses=uses,
        reads=reads,
        dims=trained,
        name=f"{name}_training",
    )
    names = naming.stage(
        Output(
            "training_correct",
            VIEW,
            "i1",
            label="1 where that category is labelled with the true ship",
        ),
        Output("names", ("category",), "i2", stored=False),
        uses=uses,
        reads={"training": f"{name}_training"},
        dims=(*trained, "label_rule"),
        name=f"{name}_names",
    )
    tests = naming.answers(
        Output("category", VIEW, "i4", label=fallen, without=rules),
        Output("similarity", VIEW, label="cosine similarity to that category", without=rules),
        without=("score_rule",),
        uses=uses,
        reads={**reads, "training": f"{name}_training", "names": f"{name}_names"},
        along=(*along, Network.label_rule, Network.score_rule),
        dims=(*trained, *rules, "learn_in_test", *tested),
        name=name,
    )
    return (
        training(categories.form_categories),
        names(categories.name_categories),
        tests(categories.answer_tests),
    )


OF_RANGE = Naming(NAME, classifier.names_by(NAME, RANGE), of="the grid", states="status")
OF_INFRARED = Naming(
    "acn_infrared",
    classifier.names_by(NAME, INFRARED),
    of="the infrared channel",
    states="status_infrared",
)
RANGE_STAGES = network(
    OF_RANGE,
    {"lessons": "profile_lessons", "presentation": "profile_order", "tests": "averaged"},
    along=(Network.orders, Grid.vigilance, Grid.frame_count),
    trained=(*OF_PROFILES, "order", "learning_rate", "vigilance"),
    tested=("replicate", "ifov_phase", "frame_count"),
    learned="expected profile",
    shown="averaged profile",
    uses=(Grid, Network),
)
INFRARED_STAGES = network(
    OF_INFRARED,
    {"lessons": "silhouette_lessons", "presentation": "silhouette_order", "tests": "log_polar"},
    along=(Infrared.orders, Infrared.vigilance, Infrared.frame_count),
    trained=(*OF_SILHOUETTES, "phase", "order", "learning_rate", "vigilance"),
    tested=LOOK,
    learned="noiseless silhouette",
    shown="silhouette",
    uses=(Infrared, Network),
)


def tabulate_silhouettes(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return scores of silhouettes by aspect bin, of the ships learned, and categories formed."""
    known = classifier.known_ships(classified, choices)
    tables = formed(known, "training silhouettes")
    for prefix in ("training_", ""):
        what = f"{prefix or 'test_'}silhouettes".replace("_", " ")
        of_kinds = {} if prefix else classifier.aspects_of(choices)
        score = partial(scored, prefix=prefix, what=what)
        tables |= by_aspects(known[prefix + "correct"], of_kinds, score)
    return data_set(tables, known.aspect)


SETTINGS: tuple[type[Settings], ...] = (Network,)
STAGES: tuple[Stage, ...] = (
    *(profile_lessons, silhouette_lessons, profile_order, silhouette_order),
    *(*RANGE_STAGES, *INFRARED_STAGES),
)
TABLES = (
    *OF_RANGE.tables(rejecting=True),
    *OF_INFRARED.tables(tabulate_silhouettes, rejecting=True),
)
