"""Naming measured profiles: every classifier as the library has it, and who is asked."""

import warnings

import numpy as np
import pytest
import xarray as xr
from flight_sweeps import EXPERIMENT, checked, flown, opened, read
from sklearn.exceptions import ConvergenceWarning

from ncti.classify import AdaptiveClusteringNetwork, CorrelationNeighbour, GainAnnealedNetwork
from ncti.evaluate import aspect_bins
from ncti.features import profile_vector
from sweeps.engine.plan import Plan
from sweeps.stages import classifier
from sweeps.stages.acn import profile_order
from sweeps.stages.classifier import Classifier
from sweeps.stages.measured import lesson, measured, namer, tabulate_measured
from sweeps.stages.mnn import Mnn, mnn_settings
from sweeps.stages.signatures import KINDS

SHIPS, ASPECTS, BINS = ("a", "b", "c"), (0.0, 30.0, 60.0, 90.0), 120
VIEWS = (len(SHIPS), len(ASPECTS))
LEARNED, TEST, MEASURED = range(len(KINDS))
NAMES = ("acn", "mnn", "correlation")
ALL = np.ones(VIEWS, dtype=bool)


@pytest.fixture
def signatures():
    """(ship, aspect, kind, bin): ragged made profiles above a floor; tests with some noise,
    measured ones with more. The last ship is not flown past.
    """
    rng = np.random.default_rng(3)
    learned = np.zeros((*VIEWS, BINS))
    learned[..., 20:100] = rng.exponential(1.0, (*VIEWS, 80))
    found = np.repeat(learned[:, :, None], len(KINDS), axis=2)
    for kind, scatter in ((TEST, 0.2), (MEASURED, 3.0)):
        noise = rng.normal(0, scatter, found[:, :, kind].shape)
        found[:, :, kind] += np.where(np.arange(BINS) % 119 == 0, 0.0, noise)
    found += 5.0
    found[2, :, MEASURED] = np.nan
    return found.astype(np.float32)


def training_views(name, **changes):
    """The lesson of a classifier, with few epochs."""
    choices = read()
    names = (setting for setting in EXPERIMENT.declared if setting.key.startswith("classifier."))
    given = {setting.name: choices[setting][0] for setting in names}
    given |= {"name": name, "vigilance": 0.9, "epochs": 60} | changes
    of_mnn = {one.key.rpartition(".")[2]: given[one.name] for one in Mnn.declared}
    given["mnn_settings"] = mnn_settings(**of_mnn)
    given["profile_order"] = profile_order(given["order"], 0)
    return lesson(**{key: given[key] for key in lesson.arguments})


class Fixed:
    """A generator whose one draw is known."""

    def integers(self, below):
        assert below == 2**32
        return 11


def named(signatures, name, there=ALL, unknown=None, **changes):
    """What a classifier calls signatures that it learned the synthetic ones of."""
    known = signatures[:, :, LEARNED]
    learned = classifier.training_views(SHIPS, ASPECTS, unknown, None)
    pupil = namer(training_views(name, **changes), known, there, learned, ASPECTS, Fixed())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return measured(pupil, signatures, there)


@pytest.mark.filterwarnings(f"ignore::{ConvergenceWarning.__module__}.ConvergenceWarning")
@pytest.mark.parametrize(
    ("name", "vigilance"), [("acn", 0.9), ("acn", 0.5), ("mnn", 0.9), ("correlation", 0.9)]
)
def test_answers_are_those_of_the_library(signatures, name, vigilance):
    answers = named(signatures, name, vigilance=vigilance)
    ship = np.repeat(np.arange(len(SHIPS)), len(ASPECTS))
    labels, group = aspect_bins(np.array(ASPECTS))
    classes = ship * len(labels) + np.tile(group, len(SHIPS))
    vectors = profile_vector(signatures[:, :, LEARNED].reshape(-1, BINS))
    pupil = {
        "acn": AdaptiveClusteringNetwork(vigilance=vigilance, learning_rate=0.1),
        "mnn": GainAnnealedNetwork(
            epochs=60, learning_rate=0.015, tolerance=0.35, scaling="common", random_state=11
        ),
        "correlation": CorrelationNeighbour(),
    }[name].fit(vectors, classes if name == "mnn" else ship)
    wrong = 0
    for kind in range(len(KINDS)):
        asked = ship < 2 if kind == MEASURED else ship < len(SHIPS)
        seen = profile_vector(signatures[:, :, kind].reshape(-1, BINS)[asked])
        told = pupil.predict(seen)
        right = told == (classes if name == "mnn" else ship)[asked]
        told = told // len(labels) if name == "mnn" else told
        ours = {one: values[kind].reshape(-1) for one, values in answers.items()}
        np.testing.assert_array_equal(ours["predicted"][asked], told)
        np.testing.assert_array_equal(ours["ship_correct"][asked], told == ship[asked])
        np.testing.assert_array_equal(ours["correct"][asked], right)
        assert np.all(ours["cell"][asked] == 1)
        assert all(np.all(values[~asked] == -1) for values in ours.values())
        wrong += np.sum(~right)
    assert wrong > 0  # the test would tell answers that are all right from ours


@pytest.mark.parametrize("name", ["acn", "correlation"])
def test_measured_profiles_alike_to_the_learned_are_named_alike(signatures, name):
    signatures[:2, :, MEASURED] = 3 * (signatures[:2, :, LEARNED] - 5) + 70
    answers = named(signatures, name)
    np.testing.assert_array_equal(
        answers["predicted"][MEASURED, :2], answers["predicted"][LEARNED, :2]
    )
    if name == "correlation":
        assert np.all(answers["correct"][LEARNED] == 1)


@pytest.mark.parametrize("name", ["acn", "correlation"])
def test_a_profile_of_nothing_names_no_ship(signatures, name):
    signatures[1, 2, MEASURED] = 5.0
    answers = named(signatures, name)
    assert answers["predicted"][MEASURED, 1, 2] == -1
    assert answers["correct"][MEASURED, 1, 2] == 0


@pytest.mark.parametrize("name", NAMES)
def test_views_that_are_not_there_have_no_say(signatures, name):
    there = ALL.copy()
    there[0, 1] = False
    signatures[0, 1] = np.nan
    answers = named(signatures, name, there=there)
    assert np.all(answers["correct"][:, 0, 1] == -1) and np.all(answers["cell"][:, 0, 1] == 0)
    assert np.all(answers["correct"][TEST, 1:] >= 0)


@pytest.mark.parametrize("name", NAMES)
def test_unknown_ships_are_never_named(signatures, name):
    answers = named(signatures, name, unknown=("a",))
    assert not np.any(answers["predicted"] == 0)
    assert np.all(answers["correct"][:2, 0] == 0)


def test_a_classifier_that_cannot_name_them_is_not_asked(signatures):
    answers = named(signatures, "likelihood")
    assert all(np.all(values == -1) for values in answers.values())


def test_lessons_differ_by_what_matters_to_their_classifier():
    assert training_views("acn") != training_views("acn", vigilance=0.5)
    assert training_views("mnn") == training_views(
        "mnn", vigilance=0.5, learning_rate=0.7, label_rule="first"
    )
    assert training_views("mnn") != training_views("mnn", mnn_learning_rate=0.7)
    assert training_views("acn") == training_views("acn", mnn_learning_rate=0.7, inputs="raw")
    assert training_views("correlation") == training_views("correlation", vigilance=0.5, epochs=7)


def test_flights_share_a_training():
    """Of 2 pulse widths, 3 classifiers and 2 vigilances, which the first alone has."""
    choices = checked(
        grid__pulse_width=[30, 50], grid__vigilance=[0.9, 0.95], classifier__name=list(NAMES),
        cnr=[10, 20], mast_gain=[1, 3], errors={"ship_speed": [-1, 1]},
    )  # fmt: skip
    plan = Plan(EXPERIMENT, choices)
    keys = {
        name: {plan.key(plan.bound[name], place) for place in plan.cells(plan.bound[name])}
        for name in ("namer", "measured")
    }
    assert len(keys["namer"]) == 2 * (2 + 1 + 1)
    assert len(keys["measured"]) == 12 * len(keys["namer"])


def test_only_who_can_is_asked_where_flights_are_all_there_is():
    choices = checked(classifier__name=["likelihood", "correlation", "acn"])
    assert choices[Classifier.name] == ("acn", "correlation")
    choices = checked(sensor=["range", "irar"], classifier__name=["likelihood", "acn"])
    assert choices[Classifier.name] == ("acn", "likelihood")
    assert checked(sensor="range", classifier__name="likelihood")[Classifier.name] == (
        "likelihood",
    )


def test_tables_count_the_ships_that_are_learned_and_flown_past():
    rng = np.random.default_rng(0)
    ships = ["duncan", "horne", "roberts"]
    right = rng.integers(0, 2, (2, 3, 3, 5), dtype=np.int8)
    dims = ("replicate", "kind", "ship", "aspect")
    coords = {"kind": list(KINDS), "ship": ships, "aspect": [10.0, 20.0, 100.0, 110.0, 120.0]}
    data = {name: (dims, right) for name in ("correct", "ship_correct", "predicted")}
    choices = read(
        grid__ship=ships, flown=["horne", "roberts"], classifier__unknown="horne",
        grid__aspect=coords["aspect"],
    )  # fmt: skip
    table = tabulate_measured(xr.Dataset(data, coords), choices).sel(aspect_bin="overall")
    np.testing.assert_allclose(table.ship_accuracy, right[:, :, 2].mean(axis=(0, 2)))
    assert np.all(table.n == 10)
    assert np.all((table.ci_low <= table.accuracy) & (table.accuracy <= table.ci_high))


def test_a_sweep_names_what_it_measured(tmp_path):
    path = flown(
        tmp_path, grid__ship=["duncan", "roberts"], grid__aspect=[172, 175], flown="roberts",
        cnr=[10, 20], errors={"aircraft_speed": 1}, classifier__name=["acn", "correlation"],
        grid__pulse_width=[30, 50],
    )  # fmt: skip
    answers, flights = opened(path, "classification/measured"), opened(path)
    behind = ("kind", "ship", "aspect")
    front = ("pulse_width", "classifier", "vigilance", "range", "cnr", "error")
    assert answers.correct.dims == (*front, *behind)
    assert answers.kind.values.tolist() == list(KINDS)
    assert answers.classifier.values.tolist() == ["acn", "correlation"]
    assert answers.predicted.dtype == "i2" and answers.correct.dtype == "i1"
    # As the library does it, of one flight.
    one = {"pulse_width": 50, "cnr": 10, "range": 3}
    seen = flights.signature.sel(one).isel(error=1).transpose(*behind, "down_range").values
    known = profile_vector(seen[LEARNED].reshape(-1, 250))
    pupil = CorrelationNeighbour().fit(known, [0, 0, 1, 1])
    told = pupil.predict(profile_vector(seen[MEASURED, 1]))
    ours = answers.predicted.sel(one | {"classifier": "correlation"}).isel(error=1).squeeze()
    np.testing.assert_array_equal(ours.sel(kind="measured", ship="roberts"), told)
    status = opened(path, "status_measured").cell
    assert np.all(status.sel(kind=["learned", "test"]) == 1)
    assert np.all(status.sel(kind="measured", ship="roberts") == 1)
    assert np.all(status.sel(kind="measured", ship="duncan") == -1)
    tables = opened(path, "tables/measured").sel(aspect_bin="overall")
    of_ship = answers.sel(ship="roberts")
    np.testing.assert_allclose(tables.accuracy, of_ship.correct.mean("aspect"))
    assert np.all(tables.n == 2)


def test_every_variable_has_units_and_a_name(tmp_path):
    tree = xr.open_datatree(flown(tmp_path, classifier__name="correlation"), engine="zarr")
    assert {"/validation", "/classification/measured", "/status_measured"} < set(tree.groups)
    for node in tree.subtree:
        for name, variable in node.to_dataset().variables.items():
            assert variable.attrs["long_name"], name
            if variable.dtype.kind not in "OTU":
                assert variable.attrs["units"], name
