"""The reports of classifiers, run small."""

import json

import numpy as np
import pytest

from ncti.classify import CorrelationNeighbour
from sweeps.benchmark import __main__ as command
from sweeps.benchmark import classifiers
from sweeps.benchmark.reports import Column, Report


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
