"""The Adaptive Clustering Network, trained on noiseless silhouettes and tested on those of images.

Training presents the views in several orders; the map of an empty silhouette is zero everywhere,
matches no category and so names no ship, which counts as wrong.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.classify.vigilance_sweep import Similarities
from ncti.evaluate import wilson_interval
from sweeps.engine.seeds import cell_rng
from sweeps.engine.settings import Choices, Run
from sweeps.engine.stage import Output, Stage, Table, in_memory, stage
from sweeps.stages.acn import NAME as ACN
from sweeps.stages.acn import Lessons, Network
from sweeps.stages.categories import (
    answer_tests,
    clustering_of,
    form_categories,
    match_learning,
    name_categories,
)
from sweeps.stages.classifier import NONE, STATE, Classifier, learned, names_by, state
from sweeps.stages.images import LOOK, VIEW
from sweeps.stages.infrared import Infrared
from sweeps.stages.rejection import rejection_table
from sweeps.stages.scores import data_set, formed, known_ships, scored
from sweeps.stages.silhouettes import OF_SILHOUETTES, STEPS
from sweeps.stages.views import INFRARED, Grid

if TYPE_CHECKING:
    import xarray as xr

Arrays = dict[str, NDArray[Any]]

GROUP = "classification/acn_infrared"
TRAINED = (*OF_SILHOUETTES, "phase", "order", "learning_rate", "vigilance")
DRAWS = ("phase", "order")  # what scores are averaged over

named_by_acn = names_by(ACN, INFRARED)


def map_vectors(maps: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return (..., ship, aspect, angle, radius) maps as (..., view, feature) vectors."""
    flat = maps.reshape(*maps.shape[:-4], -1, maps.shape[-2] * maps.shape[-1])
    return np.asarray(flat * np.float32(1 / STEPS), dtype=np.float32)


def presentation_order(views: int, order: int, seed: int) -> NDArray[np.intp]:
    """Return an order of presentation of all views: the grid's own, or of a number from 1 on."""
    if order == 0:
        return np.arange(views)
    return cell_rng(seed, stage="presentation_order", order=order).permutation(views)


@in_memory(gather=(Grid.ship, Grid.aspect), keep=4)
def silhouette_lessons(template_log_polar: NDArray[np.uint8], there: NDArray[np.bool_]) -> Lessons:
    """Return what all trainings with the same silhouettes share."""
    training = map_vectors(template_log_polar).astype(np.float64)
    return Lessons(training, Similarities.of(training), there)


@stage(
    Output("training_category", VIEW, "i4", label="category of the noiseless silhouette"),
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
    uses=(Infrared, Grid, Classifier, Network, Run),
    gather=(Grid.ship, Grid.aspect),
    group=GROUP,
    dims=TRAINED,
    when=named_by_acn,
    status="-",
)
def acn_infrared_training(
    silhouette_lessons: Lessons,
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    unknown: tuple[str, ...] | None,
    training_aspect: tuple[float, ...] | None,
    vigilance: float,
    learning_rate: float,
    max_passes: int,
    orders: int,
    seed: int,
) -> Arrays:
    """Return the categories that noiseless silhouettes form."""
    there = silhouette_lessons.there
    return form_categories(
        silhouette_lessons.similarities,
        learned(ship, aspect, unknown, training_aspect) & there,
        presentation_order(there.size, orders, seed),
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=max_passes,
    )


@stage(
    Output("training_correct", VIEW, "i1", label="1 where that category has the ship's name"),
    Output("names", ("category",), "i2", stored=False),
    uses=(Infrared, Network, Run),
    group=GROUP,
    dims=(*TRAINED, "label_rule"),
    when=named_by_acn,
    status="-",
)
def acn_infrared_names(
    acn_infrared_training: Arrays, label_rule: str, orders: int, seed: int
) -> Arrays:
    """Return the ship of every category, and whether it is the right one."""
    order = presentation_order(acn_infrared_training["training_category"].size, orders, seed)
    names, correct = name_categories(acn_infrared_training, order, label_rule)
    return {"training_correct": correct, "names": names}


@stage(
    Output(
        "category",
        VIEW,
        "i4",
        label="category that the silhouette falls into",
        without=("label_rule", "score_rule"),
    ),
    Output(
        "similarity",
        VIEW,
        label="cosine to that category",
        without=("label_rule", "score_rule"),
    ),
    Output(
        "predicted",
        VIEW,
        "i2",
        label="ship named, as an index into the ship axis",
        without=("score_rule",),
    ),
    Output("correct", VIEW, "i1", label="1 where the answer is right"),
    Output(
        "cell",
        VIEW,
        "i1",
        label="state of a cell of the infrared channel",
        failed=0,
        group="status_infrared",
        attrs=STATE,
    ),
    uses=(Infrared, Network, Run),
    along=(
        *(Infrared.orders, Infrared.vigilance, Infrared.frame_count),
        *(Network.label_rule, Network.score_rule),
    ),
    gather=(Grid.ship, Grid.aspect),
    group=GROUP,
    dims=(*TRAINED, "label_rule", "score_rule", *LOOK),
    when=named_by_acn,
    status="-",
)
def acn_infrared(
    silhouette_lessons: Lessons,
    acn_infrared_training: Arrays,
    acn_infrared_names: Arrays,
    log_polar: NDArray[np.uint8],
    there: NDArray[np.bool_],
    orders: tuple[int, ...],
    vigilance: tuple[float, ...],
    frame_count: tuple[int, ...],
    label_rule: tuple[str, ...],
    score_rule: tuple[str, ...],
    learning_rate: float,
    max_passes: int,
    learn_in_test: bool,
    seed: int,
) -> Arrays:
    """Return what silhouettes are named, one number of frames, order and vigilance at a time."""
    lengths = tuple(map(len, (orders, vigilance, frame_count, label_rule, score_rule)))
    whole = (*lengths, *there.shape)
    answers: Arrays = {
        "category": np.full(whole, NONE),
        "similarity": np.full(whole, np.nan),
        "predicted": np.full(whole, NONE),
        "correct": np.full(whole, NONE),
    }
    for f in range(len(frame_count)):
        tests = map_vectors(log_polar[f]).astype(np.float64)
        seen = silhouette_lessons.similarities.to(tests)
        for o, v in np.ndindex(lengths[:2]):
            formed = {name: values[o, v] for name, values in acn_infrared_training.items()}
            if learn_in_test:
                category, cosine = match_learning(
                    silhouette_lessons.vectors,
                    tests,
                    formed["training_confused"] >= 0,
                    presentation_order(there.size, orders[o], seed),
                    vigilance=vigilance[v],
                    learning_rate=learning_rate,
                    max_passes=max_passes,
                )
            else:
                category, cosine = clustering_of(formed).match(seen)
            category = category.reshape(there.shape)
            answers["category"][o, v, f] = np.where(there, category, NONE)
            answers["similarity"][o, v, f] = np.where(there, cosine.reshape(there.shape), np.nan)
            for k in range(len(label_rule)):
                names = acn_infrared_names["names"][o, v, k]
                predicted, correct = answer_tests(category, there, formed, names, score_rule)
                answers["predicted"][o, v, f, k] = predicted
                answers["correct"][o, v, f, k] = correct
    return answers | {"cell": state(answers["correct"], there)}


def tabulate_silhouettes(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Tabulate the answers about silhouettes, averaged over phases and orders.

    Parameters
    ----------
    classified : xarray.Dataset
        The store's group of classified silhouettes.
    choices : Choices
        Of the sweep.

    Returns
    -------
    xarray.Dataset
        As of `sweeps.stages.scores.tabulate_answers`. Accuracies are means over the phases and
        orders that have answers, with `..._spread`, their standard deviation; both are NaN where
        none has. Intervals are those of the mean for `..._n` answers, the views of one phase and
        order: all of them see the same views, and more looks at a view are no more views.
    """
    known = known_ships(classified, choices)
    tables = formed(known, "training silhouettes")
    for prefix, name, what in (
        ("training_", "training_correct", "training silhouettes"),
        ("", "correct", "test silhouettes"),
    ):
        found = scored(known[name], prefix, what)
        fraction = found[prefix + "accuracy"][0]
        # A training that failed has no answers, and any other has those of all views there are.
        n = found[prefix + "n"][0].max(DRAWS)
        mean = fraction.mean(DRAWS)
        low, high = wilson_interval((mean.fillna(0) * n).clip(0, n), n)
        tables |= {
            prefix + "accuracy": (mean, f"mean {found[prefix + 'accuracy'][1]}"),
            prefix + "spread": (
                fraction.std(DRAWS),
                f"standard deviation of that fraction over {' and '.join(DRAWS)}",
            ),
            prefix + "ci_low": (mean.copy(data=low), found[prefix + "ci_low"][1]),
            prefix + "ci_high": (mean.copy(data=high), found[prefix + "ci_high"][1]),
            prefix + "n": (n, found[prefix + "n"][1]),
        }
    return data_set(tables, known.aspect)


STAGES: tuple[Stage, ...] = (
    *(silhouette_lessons, acn_infrared_training),
    *(acn_infrared_names, acn_infrared),
)
TABLES = (
    Table("tables/acn_infrared", (GROUP,), tabulate_silhouettes, named_by_acn),
    rejection_table("acn_infrared", GROUP, named_by_acn),
)
