"""The benchmark: classifiers on the splits of `ncti.data`, all learning from the same views.

`entry` declares a classifier by a function that fits it; docs/benchmark.md shows how to add one.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.data.moments import moments
from ncti.data.splits import (
    OUTSIDERS,
    PER_VIEW,
    SPLITS,
    TEST,
    TEST_ROWS,
    TRAIN,
    TRAINING_ROWS,
    UNKNOWN,
    rows_of,
    same_training_split,
)
from ncti.data.vectors import to_numpy
from ncti.features import profile_vector
from ncti.ladar.loops import FRAMES
from ncti.machine_code import CompiledLoops
from ncti.render.loops import LINES, engine_loops
from studies.benchmark.summary import tabulate_differences, tabulate_rows
from sweeps.engine.declare.display import Display, Figure
from sweeps.engine.declare.settings import Choices, Run, Settings, count, set_of, word
from sweeps.engine.declare.stage import (
    RNG,
    Group,
    Output,
    Stage,
    Stream,
    Table,
    derived,
    in_memory,
    inner,
    stage,
)
from sweeps.stages import meshes
from sweeps.stages.meshes import MeshSource
from sweeps.stages.refusals import refuse
from sweeps.stages.ships import ShipName
from sweeps.stages.views import SHAPES, Arrays, Floats, Grid, uses_sensor

if TYPE_CHECKING:
    import xarray as xr

SENSOR = "benchmark"
CONF = Path(__file__).with_name("conf")
IMPORTS = (
    *("ncti.classify.likelihood", "ncti.classify.gain_annealed", "ncti.classify.baselines"),
    *("sklearn.ensemble", "sklearn.neural_network", "sklearn.discriminant_analysis"),
)
WITHOUT_EXTRAS = (
    *("likelihood", "correlation", "acn", "mnn"),
    *("random_forest", "gradient_boosting", "pca_qda", "mlp"),
)
ENTRIES = (*WITHOUT_EXTRAS, "cnn")
EXTRAS = {"cnn": "torch"}  # packages that entries need, each an extra of the same name
REFERENCE = "random_forest"  # with which the others are compared
ROWS, TEMPLATES, MOMENTS = "noisy rows", "expected profiles", "moments of frames"
UNSEEN, NO_ROW = -1, -2  # of ships: not learned, and no row

Model = Any  # a fitted classifier
Vectors = tuple[Floats, NDArray[np.str_], NDArray[Any]]


class Benchmark(Settings, key="benchmark"):
    """The benchmark of classifiers."""

    split = word(
        list(SPLITS), tuple(SPLITS), label="split into training and tests", role="dimension"
    )
    classifier = set_of(
        word(
            list(WITHOUT_EXTRAS),
            ENTRIES,
            label="classifiers of the benchmark",
            help="cnn needs the extra torch",
            not_swept="they are a set",
        )
    )
    training_rows = count(
        TRAINING_ROWS,
        low=8,
        high=10**6,
        label=f"training rows of a seed, {PER_VIEW[TRAIN]} of a view",
        not_swept=SHAPES,
    )
    test_rows = count(
        TEST_ROWS,
        low=2,
        high=10**6,
        label=f"test rows of a seed, {PER_VIEW[TEST]} of a view",
        not_swept=SHAPES,
    )


WORDS = {Benchmark.classifier: "ENTRIES"}
USED = (Benchmark, Grid, Run)
DIMS = (Benchmark.split.name, Run.seed.name)
TESTS = Group(f"{SENSOR}/tests", uses_sensor(SENSOR), USED, DIMS)


# Rows


@derived(uses=(Benchmark,))
def learned_split(split: str) -> str:
    """Return the first split with the same training, so that equal ones are learned once."""
    return same_training_split(split)


@derived()
def unknown_mesh_sources() -> tuple[MeshSource, ...]:
    """Return the sources of the ships absent from training."""
    return tuple(meshes.mesh_source(ShipName(name, name)) for name in OUTSIDERS.values())


# Coordinates of rows, attributes of their data set, and their profiles.
COORDS = {"ship": "U64", "variant": "U64", "view": "i8", "frames": "i8"} | dict.fromkeys(
    ("aspect", "depression", "slant_range", "pulse_width", "cnr"), "f8"
)
ATTRS = ("ifov_urad", "target_free_ifovs", "spacing_m", "far_field_error")
PROFILES = ("profile", "expected")


@stage(
    *(inner(name, ("row",), dtype) for name, dtype in COORDS.items()),
    *(inner(name, (), "f8") for name in ATTRS),
    *(inner(name, ("row", "down_range"), "f4") for name in PROFILES),
    inner("down_range", ("down_range",), "f8"),
    uses=USED,
    reads={"split": "learned_split"},
    gather=(Grid.ship,),
)
def learned_rows(
    split: str,
    seed: int,
    ship: tuple[ShipName, ...],
    mesh_sources: tuple[MeshSource, ...],
    training_rows: int,
) -> Arrays:
    """Return the rows to learn from."""
    rows = rows_of(split, TRAIN, seed=seed, ships=[*map(str, ship)], count=training_rows)
    names = (*COORDS, *PROFILES, "down_range")
    attributes = {name: np.array(rows.attrs[name], float) for name in ATTRS}
    return attributes | {name: rows[name].values for name in names}


@in_memory(keep=1)
def training_set(learned_rows: Arrays) -> Vectors:
    """Return vectors, ships and views of noisy rows, as `ncti.to_numpy` does."""
    return to_numpy(_rows(learned_rows))


@in_memory(keep=1)
def template_set(learned_rows: Arrays) -> Vectors:
    """Return vectors, ships and aspects of the expected profile of each view."""
    rows = _rows(learned_rows)
    _, first_rows = np.unique(rows.view.values, return_index=True)
    expected = rows.assign(profile=rows.expected).isel(row=first_rows)
    vectors, ship, _ = to_numpy(expected)
    return vectors, ship, expected.aspect.values


@in_memory(keep=1)
def moment_set(learned_rows: Arrays) -> xr.Dataset:
    """Return the exact moments of each view, of `ncti.data.moments`."""
    return moments(_rows(learned_rows))


def _rows(arrays: Arrays) -> xr.Dataset:
    """Rebuild the data set of rows from its cached arrays."""
    import xarray as xr

    coords = {name: ("row", arrays[name]) for name in COORDS}
    attributes = {name: float(arrays[name]) for name in ATTRS}
    attributes["target_free_ifovs"] = int(attributes["target_free_ifovs"])
    variables = {name: (("row", "down_range"), arrays[name]) for name in PROFILES}
    return xr.Dataset(variables, coords | {"down_range": arrays["down_range"]}, attributes)


@TESTS.stage(
    Output("true_ship", ("row",), "i2", "ship, as an index; -1: not learned", pad=NO_ROW),
    Output("true_aspect", ("row",), "f4", "aspect", "degree", pad=np.nan),
    Output("view", ("row",), "i4", "number of the view", pad=NO_ROW),
    inner("profile", ("row", "down_range"), "f4"),
    inner("frames", ("row",), "i8"),
    gather=(Grid.ship,),
)
def tested_rows(
    split: str,
    seed: int,
    ship: tuple[ShipName, ...],
    mesh_sources: tuple[MeshSource, ...],
    unknown_mesh_sources: tuple[MeshSource, ...],
    test_rows: int,
) -> Arrays:
    """Return the test rows, those of unknown ships last."""
    names = [*map(str, ship)]
    parts = [rows_of(split, TEST, seed=seed, ships=names, count=test_rows)]
    if split in OUTSIDERS:
        half = max(test_rows // 2, 1)
        parts.append(rows_of(split, UNKNOWN, seed=seed, ships=names, count=half))
    views_before = int(parts[0].view.max()) + 1
    number = {name: k for k, name in enumerate(names)}
    blocks = [
        {
            "true_ship": np.array([number.get(name, UNSEEN) for name in rows.ship.values.tolist()]),
            "true_aspect": rows.aspect.values,
            "view": rows.view.values + k * views_before,
            "profile": rows.profile.values,
            "frames": rows.frames.values,
        }
        for k, rows in enumerate(parts)
    ]
    return {name: np.concatenate([part[name] for part in blocks]) for name in blocks[0]}


# Answers


def fit(function: Callable[..., Model]) -> Stage:
    """Declare a function that returns a fitted classifier.

    Its arguments may be `training_set`, `template_set`, `moment_set`, and `rng`.
    """
    draws = RNG in signature(function).parameters
    # Splits of one training have one stream, and so one classifier.
    stream = Stream(()) if draws else None
    name = f"fit_{function.__name__}"
    return in_memory(name=name, keep=2, uses=USED, stream=stream)(function)


def entry(fitted: Stage, learns: str = ROWS) -> tuple[tuple[Stage, ...], tuple[Table, ...]]:
    """Return the stages and tables of a benchmark classifier, from the function that fits it.

    `learns` names its training data. The classifier has `predict`, and one or more of
    `predict_proba`, `match` and `decision_function`, the first of which scores the rejection of
    unknown ships; or it has `posterior`, which takes averages and numbers of frames.
    """
    name = fitted.name.removeprefix("fit_")

    def is_entered(choices: Choices) -> bool:
        return uses_sensor(SENSOR)(choices) and name in choices.value(Benchmark.classifier)

    def is_compared(choices: Choices) -> bool:
        return is_entered(choices) and REFERENCE in choices.value(Benchmark.classifier)

    group = Group(f"{SENSOR}/{name}", is_entered, USED, DIMS)
    answer_stage = group.stage(
        Output("predicted", ("row",), "i2", "ship named, as an index", pad=NO_ROW),
        Output("probability", ("row", "ship"), label="probability of each ship", pad=np.nan),
        Output("similarity", ("row",), "f8", "similarity to what was learned", pad=np.nan),
        reads={"model": fitted.name},
        gather=(Grid.ship,),
        name=f"{name}_answers",
    )(answers)
    labels = {"classifier": name, "learns": learns}
    path = f"tables/{SENSOR}_{name}"
    tables = [Table(path, (group.path, TESTS.path), tabulate, is_entered, displays(labels))]
    if name != REFERENCE:
        paths = group.path, f"{SENSOR}/{REFERENCE}", TESTS.path
        difference_displays = (replace(DIFFERENCE, labels=labels),)
        tables.append(
            Table(
                f"{path}_difference", paths, tabulate_difference, is_compared, difference_displays
            )
        )
    return (fitted, answer_stage), tuple(tables)


def answers(model: Model, tested_rows: Arrays, ship: tuple[ShipName, ...]) -> Arrays:
    """Return the ships named, their probabilities if any, and the similarity."""
    profile = tested_rows["profile"]
    X, count = profile_vector(profile), len(profile)
    likely = np.full((count, len(ship)), np.nan)
    if hasattr(model, "posterior"):
        values = model.posterior(profile.astype(np.float64), tested_rows["frames"])
    elif hasattr(model, "predict_proba"):
        values = model.predict_proba(X)
    else:
        values = None
    classes = np.searchsorted([*map(str, ship)], model.classes_)
    if values is not None:
        likely[:] = 0.0
        likely[:, classes] = values
        predicted, similarity = classes[values.argmax(axis=1)], values.max(axis=1)
    else:
        predicted = np.searchsorted([*map(str, ship)], model.predict(X))
        if hasattr(model, "match"):
            similarity = model.match(X)[1]
        else:
            similarity = np.max(np.atleast_2d(model.decision_function(X).T), axis=0)
    return {"predicted": predicted, "probability": likely, "similarity": similarity}


# Classifiers


@fit
def likelihood(moment_set: xr.Dataset, rng: np.random.Generator) -> Model:
    """Return templates of all views, their error calibrated on views left out."""
    from ncti.classify.likelihood import GaussianTemplates

    mean, ship = moment_set["mean"].values, moment_set.ship.values
    return GaussianTemplates(template_error=None).fit(
        *(mean, moment_set.covariance.values, ship),
        floor=mean[..., :1],
        aspect=moment_set.aspect.values,
        rng=rng,
    )


@fit
def correlation(template_set: Vectors) -> Model:
    """Return the nearest neighbour among expected profiles."""
    from ncti.classify.baselines import CorrelationNeighbour

    return CorrelationNeighbour().fit(*template_set[:2])


@fit
def acn(template_set: Vectors) -> Model:
    """Return the Adaptive Clustering Network of expected profiles."""
    from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork

    return AdaptiveClusteringNetwork().fit(*template_set[:2])


@fit
def mnn(template_set: Vectors, rng: np.random.Generator) -> Model:
    """Return the article's multilayered network of expected profiles, with an output per ship."""
    from ncti.classify.gain_annealed import GainAnnealedNetwork

    return GainAnnealedNetwork(random_state=_number(rng)).fit(*template_set[:2])


@fit
def random_forest(training_set: Vectors, rng: np.random.Generator) -> Model:
    """Return a random forest of 100 trees."""
    from sklearn.ensemble import RandomForestClassifier

    return RandomForestClassifier(random_state=_number(rng)).fit(*training_set[:2])


@fit
def gradient_boosting(training_set: Vectors, rng: np.random.Generator) -> Model:
    """Return gradient boosting of 100 trees per ship."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    return HistGradientBoostingClassifier(random_state=_number(rng)).fit(*training_set[:2])


@fit
def pca_qda(training_set: Vectors, rng: np.random.Generator) -> Model:
    """Return quadratic discriminants of at most 20 principal components, below rows per ship."""
    from sklearn.decomposition import PCA
    from sklearn.discriminant_analysis import QuadraticDiscriminantAnalysis
    from sklearn.pipeline import make_pipeline

    X, y, _ = training_set
    fewest = int(np.unique(y, return_counts=True)[1].min())  # their covariance has a rank below it
    components = PCA(max(1, min(20, fewest - 1)), random_state=_number(rng))
    return make_pipeline(components, QuadraticDiscriminantAnalysis(reg_param=0.01)).fit(X, y)


@fit
def mlp(training_set: Vectors, rng: np.random.Generator) -> Model:
    """Return a perceptron with a hidden layer of 64."""
    from sklearn.neural_network import MLPClassifier

    model = MLPClassifier((64,), alpha=1e-2, max_iter=100, random_state=_number(rng))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of training that has not converged
        return model.fit(*training_set[:2])


@fit
def cnn(training_set: Vectors, rng: np.random.Generator) -> Model:
    """Return a small convolutional network, of PyTorch."""
    from studies.benchmark.convolutional import ConvolutionalNetwork

    return ConvolutionalNetwork(random_state=_number(rng)).fit(*training_set[:2])


def _number(rng: np.random.Generator) -> int:
    """Return a seed for scikit-learn."""
    return int(rng.integers(2**32))


# Tables

_percent = partial(Figure, percent=True, format=".0f")
INTERVAL = "With 95 % intervals of means over seeds, which draw training and tests anew."


def chance(choices: Choices) -> float:
    """Return percent correct of a random answer."""
    return 100.0 / len(choices[Grid.ship])


def displays(labels: dict[str, str]) -> tuple[Display, ...]:
    """Return the displays of one classifier: percent correct by split and aspect, other scores."""
    classifier_label = {"classifier": labels["classifier"]}
    return (
        Display(
            SENSOR,
            "Ships named correctly [%], by split",
            (_percent("accuracy", "percent_correct", extra_columns={"n": "accuracy_n"}),),
            rows=tuple(labels),
            columns=Benchmark.split.name,
            labels=labels,
            chance=chance,
            notes=(INTERVAL,),
        ),
        Display(
            f"{SENSOR}_aspects",
            "Ships named correctly [%], by aspect [deg]",
            (_percent("aspect_accuracy", "percent_correct"),),
            rows=("classifier",),
            columns="aspect_bin",
            labels=classifier_label,
            chance=chance,
            notes=("With 95 % Wilson intervals of the views of all seeds.",),
        ),
        Display(
            f"{SENSOR}_scores",
            "Probabilities and rejection",
            (
                _percent("kept", "percent_kept"),
                *(Figure(name, digits=3, format=".2f") for name in ("auroc", "oscr")),
                *(Figure(name, digits=3, format=".2f") for name in ("log_loss", "ece")),
            ),
            rows=("classifier",),
            labels=classifier_label,
            notes=(
                "percent_kept: known ships named correctly and accepted where 90 % of the rows of "
                "an unknown ship are rejected. " + INTERVAL,
            ),
        ),
    )


DIFFERENCE = Display(
    f"{SENSOR}_differences",
    f"Ships named correctly more often than by {REFERENCE} [%]",
    (_percent("difference", "percent_more", extra_columns={"p_value": "p_value"}),),
    rows=("classifier",),
    columns=Benchmark.split.name,
    notes=(INTERVAL + " p_value: McNemar's test of the views of all seeds.",),
)


def add_seed_dimension(data: xr.Dataset) -> xr.Dataset:
    """Return a group of the store with a dimension of seeds, even for a single one."""
    seed = Run.seed.name
    return data if seed in data.dims else data.expand_dims(seed)


def tabulate(answers: xr.Dataset, tests: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return all scores of one classifier."""
    return tabulate_rows(add_seed_dimension(answers), add_seed_dimension(tests))


def tabulate_difference(
    answers: xr.Dataset, others: xr.Dataset, tests: xr.Dataset, choices: Choices
) -> xr.Dataset:
    """Return the difference in accuracy between one classifier and the reference."""
    return tabulate_differences(*map(add_seed_dimension, (answers, others, tests)))


CLASSIFIER_ENTRIES = tuple(
    entry(*arguments)
    for arguments in (
        (likelihood, MOMENTS),
        *((fitted, TEMPLATES) for fitted in (correlation, acn, mnn)),
        *((fitted, ROWS) for fitted in (random_forest, gradient_boosting, pca_qda, mlp, cnn)),
    )
)


def loops(choices: Choices) -> list[CompiledLoops]:
    """Return the compiled loops that simulate rows."""
    return [FRAMES, engine_loops(LINES)] if uses_sensor(SENSOR)(choices) else []


STAGES = (
    learned_split,
    unknown_mesh_sources,
    learned_rows,
    training_set,
    template_set,
    moment_set,
    tested_rows,
    *(declared for stages, _ in CLASSIFIER_ENTRIES for declared in stages),
)
TABLES = tuple(table for _, tables in CLASSIFIER_ENTRIES for table in tables)


# Checks


def check_first(choices: Choices) -> None:
    """Refuse (`ConfigurationError`) ships that no split can learn, and missing classifiers."""
    if uses_sensor(SENSOR)(choices):
        for name in choices.value(Benchmark.classifier):
            if name in EXTRAS and find_spec(EXTRAS[name]) is None:
                needed = f"used with {EXTRAS[name]}: pip install 'ncti-sweep[{EXTRAS[name]}]'"
                refuse(Benchmark.classifier, name, needed)
        for ship in choices[Grid.ship]:
            if ship.source != str(ship) or str(ship.transform) or str(ship) in OUTSIDERS.values():
                unknown = ", ".join(OUTSIDERS.values())
                refuse(Grid.ship, str(ship), f"a known name without a transform, not of {unknown}")
        if len(choices[Grid.ship]) < 2:
            refuse(Grid.ship, str(choices[Grid.ship][0]), "at least two ships to be told apart")
