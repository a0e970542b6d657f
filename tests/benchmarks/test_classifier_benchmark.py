"""The reports of classifiers, run small."""

import json

import numpy as np
import pytest
from sklearn.exceptions import ConvergenceWarning

from benchmarks import __main__ as command
from benchmarks import classifiers, convergence
from benchmarks.reports import Column, Report
from ncti.classify import CorrelationNeighbour, GainAnnealedNetwork
from ncti.ladar import noise_floor


@pytest.fixture(scope="module")
def task():
    """Two ships at four aspects, 2 averages of each."""
    return classifiers.source_task(("duncan", "spruance"), (0.0, 30.0, 45.0, 75.0), 2)


def test_tests_are_averages_of_the_views_in_their_order(task):
    assert task.expected.shape == (8, 250)
    assert task.tests.shape == task.averaged.shape == (16, 250)
    assert task.covariance.shape[::2] == task.expected.shape
    np.testing.assert_array_equal(task.ship, [0, 0, 0, 0, 1, 1, 1, 1])
    np.testing.assert_array_equal(task.group, [0, 1, 1, 2] * 2)
    np.testing.assert_array_equal(task.true_label, np.tile([0, 1, 1, 2, 3, 4, 4, 5], 2))
    # Each average lies about its own view: the standardised residuals of all bins have mean
    # square 1. Neighbouring bins are correlated over the lags of the band, so that its relative
    # deviation has variance below 2 (2 lags - 1) / count; five of them. Any other view's mean is
    # many deviations off.
    views, lags, bins = task.covariance.shape
    averages = task.averaged.reshape(-1, views, bins)
    deviation = np.sqrt(task.covariance[:, 0] / classifiers.FRAMES)
    square = np.mean(((averages - task.expected) / deviation) ** 2)
    assert square == pytest.approx(1, abs=5 * np.sqrt(2 * (2 * lags - 1) / averages.size))
    shifted = np.mean(((averages - np.roll(task.expected, 1, axis=0)) / deviation) ** 2)
    assert shifted > 2


def test_each_view_has_the_floor_of_its_own_ifovs(task):
    """Target-free ones and the ship's: abeam there are more of these than at the bow.

    What the pulse's tail brings to the window's edge is a hundredth of one of them, at most.
    """
    floor = task.floor
    assert floor.shape == (8, 1)
    ifovs = floor[:, 0] / noise_floor()
    np.testing.assert_allclose(ifovs, np.rint(ifovs), atol=0.01)
    on_target = ifovs - classifiers.SIGNAL["target_free_ifovs"]
    assert (on_target > 0).all()
    assert on_target[3] > on_target[0]
    # As high as both ends of the profile, and what rises above it is the ship's.
    one = 0.01 * noise_floor()
    np.testing.assert_allclose(task.expected[:, -1:], floor, atol=one)
    assert (task.expected >= floor - one).all()


def test_every_classifier_has_times_and_a_score(task):
    report = classifiers.measure(repeats=2, task=task)
    rows = {row["classifier"]: row for row in report.rows}
    assert list(rows) == list(classifiers.contenders(1))
    for row in rows.values():
        for key in ("fit_ms", "predict_ms", "over_neighbours", "over_perceptron"):
            assert row[key].n == 2
            assert 0 < row[key].low <= row[key].median <= row[key].high
            assert row[f"{key}_median"] == row[key].median
        assert 0 <= row["right_percent"] <= 100
    assert rows[classifiers.NEIGHBOURS]["over_neighbours"].low == 1
    assert rows[classifiers.PERCEPTRON]["over_perceptron"].high == 1


def test_all_nearest_neighbours_by_cosine_get_the_same_right(task):
    report = classifiers.measure(repeats=1, task=task)
    right = {row["classifier"]: row["right_percent"] for row in report.rows}
    named = CorrelationNeighbour().fit(task.training, task.ship).predict(task.tests)
    expected = 100 * np.mean(named == task.true_ship)
    for name in ("CorrelationNeighbour", "NearestNeighbors", "KNeighborsClassifier"):
        assert right[name] == expected


def test_shared_cosines_answer_as_a_network_each(task):
    report = classifiers.measure_vigilances(
        repeats=1, task=task, vigilances=((0.9,), (0.5, 0.9, 0.99))
    )
    assert [row["vigilances"] for row in report.rows] == [1, 3]
    for row in report.rows:
        assert row["same_percent"] == 100
        assert row["ratio"].median == pytest.approx(
            row["together_ms"].median / row["loop_ms"].median
        )


def test_one_name_asks_for_all_reports_of_classifiers(monkeypatch, tmp_path, capsys):
    def named(name):
        return lambda asked: Report("", (Column("name", "name"),), [{"name": name}])

    for name in command.REPORTS:
        monkeypatch.setitem(command.REPORTS, name, named(name))
    path = tmp_path / "figures.json"
    command.main(["classifiers", "--json", str(path)])
    written = set(json.loads(path.read_text())) - {"machine"}
    assert written == set(command.SETS["classifiers"])
    assert written < set(command.REPORTS)
    printed = capsys.readouterr().out
    assert all(name in printed for name in written)


def test_training_is_compared_state_by_state(task):
    report = convergence.measure(repeats=2, task=task, states=2, rates=(0.05,))
    assert [row["annealing"] for row in report.rows] == ["yes", "no"]
    for row, annealing in zip(report.rows, (True, False), strict=True):
        networks = [
            GainAnnealedNetwork(annealing=annealing, learning_rate=0.05, random_state=state).fit(
                task.training, task.label
            )
            for state in range(2)
        ]
        assert row["met"] == 2
        assert all(network.converged_ for network in networks)
        epochs = [network.n_iter_ for network in networks]
        assert (row["epochs"].low, row["epochs"].high) == (min(epochs), max(epochs))
        assert row["ms"].n == 4
        assert row["ms"].low > 0
        assert 0 <= row["right_percent"].low <= row["right_percent"].high <= 100
    assert report.rows[0]["ratio"] > 0
    assert report.rows[1]["ratio"] == 1


def test_training_that_takes_too_long_is_not_met(task, monkeypatch):
    monkeypatch.setattr(convergence, "LONGEST", 3)
    report = convergence.measure(repeats=1, task=task, states=2, rates=(0.05,))
    for row in report.rows:
        assert row["met"] == 0
        assert row["epochs"].low == row["epochs"].high == 3


def test_course_is_that_of_one_long_training(task):
    counts = (5, 20, 45)
    report = convergence.measure_course(task=task, states=1, epochs=counts)
    places = [(row["epochs"], row["annealing"]) for row in report.rows]
    assert places == [(count, way) for count in counts for way in ("yes", "no")]
    for annealing in (True, False):
        network = GainAnnealedNetwork(
            annealing=annealing, tolerance=convergence.NEVER, epochs=60, random_state=0
        )
        with pytest.warns(ConvergenceWarning):
            network.fit(task.training, task.label)
        word = "yes" if annealing else "no"
        errors = [row["error"].median for row in report.rows if row["annealing"] == word]
        # The same operations in the same order.
        assert errors == [network.loss_curve_[count] ** 0.5 for count in counts]
