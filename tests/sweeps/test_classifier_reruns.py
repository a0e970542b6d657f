"""A tiny sweep of all classifiers of range profiles: what runs again, and what does not."""

import re

import numpy as np
import pytest
import xarray as xr
from classifier_sweep import NAMES, STATES, group, rows_of, run
from sweeping import contents

from sweeps import graph, stages


def never(*args, **kwargs):
    raise AssertionError("a finished stage was computed again")


STAGES = (
    *("range_image", "range_extent", "sample_frames", "expected_profile"),
    "banded_frame_moments",
)


def test_other_settings_of_classifiers_draw_nothing_again(swept, tmp_path, monkeypatch):
    for name in STAGES:
        monkeypatch.setattr(stages, name, never)
    given = (
        "classifier.gain_sigma=0.5",
        "classifier.nugget=0.01",
        "classifier.left_out=false",
        "classifier.training=noisy",
        "classifier.mnn.epochs=[3,5]",
        "classifier.mnn.inputs=floor_removed",
        "classifier.mnn.annealing=true",
        "grid.vigilance=0.8",
    )
    run(monkeypatch, tmp_path, *given, cache=swept / "cache")
    for name in NAMES:
        assert np.all(group(tmp_path, STATES[name]).cell == 1)
    answers = group(tmp_path, "classification/mnn")
    assert answers.presentations.isel(pulse_width=0, range=0).values.tolist() == [3, 5]
    for name, dims in (("correlation", {"training", "left_out"}), ("likelihood", {"gain_sigma"})):
        assert not dims & set(group(tmp_path, f"tables/{name}").dims)


def test_one_classifier_alone(swept, tmp_path, monkeypatch, capsys):
    """What it needs is measured, what others need is not; its answers are the same."""
    for name in STAGES:
        monkeypatch.setattr(stages, name, never)
    run(monkeypatch, tmp_path, "classifier=mnn", cache=swept / "cache")
    tree = xr.open_datatree(tmp_path / "s.zarr", engine="zarr")
    assert {node.path.strip("/") for node in tree.subtree if node.has_data} == {
        *("range_profile", "status", "status_mnn", "classification/mnn", "tables/mnn")
    }
    assert "covariance" not in tree["range_profile"]
    assert np.all(tree["status_mnn"].cell == 1)
    assert np.all(tree["status"].view == 1)
    assert "cell" not in tree["status"]
    assert set(contents(tmp_path / "s-tables")) == {"classifiers.csv"}
    rows = rows_of(tmp_path)
    assert {row["points_below_bound"] for row in rows} == {""}
    # Weights are drawn by cell, whoever else names ships; products of this process may
    # round otherwise, which 40 epochs do not make much of.
    ours, theirs = (group(folder, "classification/mnn") for folder in (tmp_path, swept))
    xr.testing.assert_allclose(ours.loss, theirs.loss, rtol=1e-4)
    assert "maximum likelihood" not in capsys.readouterr().out.partition("Below bound")[0]


IMAGER = (
    *("infrared.range=25", "infrared.phases=1", "infrared.orders=1"),
    *("infrared.super_resolution=none", "grid.vigilance=0.9"),
)


def test_likelihood_with_both_sensors(swept, tmp_path, monkeypatch, capsys):
    given = ("classifier=likelihood", "sensor=both", *IMAGER)
    run(monkeypatch, tmp_path, *given, cache=swept / "cache")
    ours, theirs = (group(folder, "classification/likelihood") for folder in (tmp_path, swept))
    # Of the same profiles and covariances; log-likelihoods of some 1e3 may round to 1e-12 of them.
    xr.testing.assert_allclose(ours.probability, theirs.probability, atol=1e-5)
    xr.testing.assert_equal(ours.predicted, theirs.predicted)
    files = {f"infrared_{name}.csv" for name in ("sensor", "detection", "super_resolution")}
    assert set(contents(tmp_path / "s-tables")) == {"classifiers.csv"} | files
    assert {row["classifier"] for row in rows_of(tmp_path)} == {"likelihood"}
    printed = capsys.readouterr().out
    for title in ("Percent correct by classifier", "Passive-infrared sensor", "Ships detected"):
        assert title in printed
    assert "silhouettes" not in printed


def test_an_imager_whose_silhouettes_nobody_names(swept, tmp_path, monkeypatch, capsys):
    given = ("classifier=mnn", "sensor=infrared", "irar.range=3", *IMAGER)
    run(monkeypatch, tmp_path, *given, cache=swept / "cache")
    files = {f"infrared_{name}.csv" for name in ("sensor", "detection", "super_resolution")}
    assert set(contents(tmp_path / "s-tables")) == files
    told = capsys.readouterr()
    assert "Ships detected" in told.out
    assert told.err.startswith("ncti-sweep: classifier.name has mnn, which names nothing here: ")
    unread = "ncti-sweep: irar.range is set, but is not read where sensor is infrared\n"
    assert told.err.count(unread) == 1


def test_a_sweep_that_was_killed_goes_on(swept, tmp_path, monkeypatch):
    """Amid the classifiers: some are done, the others missing; then the store is the same."""

    class Killed(BaseException):
        pass

    def kill(*args, **kwargs):
        raise Killed

    monkeypatch.setattr(graph, "name_by_correlation", kill)
    with pytest.raises(Killed):
        run(monkeypatch, tmp_path, cache=swept / "cache")
    for name, state in {"acn": 1, "mnn": 1, "correlation": -1, "likelihood": -1}.items():
        assert np.all(group(tmp_path, STATES[name]).cell == state)
        predicted = group(tmp_path, f"classification/{name}").predicted
        assert np.all(predicted == -1) == (state == -1)
    assert not (tmp_path / "s.zarr" / "tables" / "mnn").exists()
    monkeypatch.undo()
    run(monkeypatch, tmp_path, cache=swept / "cache")
    assert contents(tmp_path / "s.zarr") == contents(swept / "s.zarr")
    assert contents(tmp_path / "s-tables") == contents(swept / "s-tables")


def test_a_classifier_that_fails_is_named_and_the_rest_is_done(
    swept, tmp_path, monkeypatch, capsys
):
    whole = graph.name_by_likelihood

    def broken(profiles, covariance, **settings):
        if covariance[0, 1, 0] == lower:
            raise ArithmeticError("a storm")
        return whole(profiles, covariance, **settings)

    # The covariance of neighbours tells the pulse widths apart.
    lower = group(swept, "range_profile").covariance.sel(pulse_width=30).values[0, 0, 0, 1, 0]
    monkeypatch.setattr(graph, "name_by_likelihood", broken)
    run(monkeypatch, tmp_path, cache=swept / "cache", code=1)
    told = capsys.readouterr()
    assert (
        "classification of likelihood pulse_width=30 range=100 (ArithmeticError: a storm)"
        in told.err
    )
    assert not re.search(r"\b(nan|None)\b", told.out)
    states = group(tmp_path, "status_likelihood").cell
    assert np.all(states.sel(pulse_width=30) == 0)
    assert np.all(states.sel(pulse_width=50) == 1)
    for name in NAMES[:3]:
        assert np.all(group(tmp_path, STATES[name]).cell == 1)
    tables = group(tmp_path, "tables/likelihood")
    assert np.all(tables.n.sel(pulse_width=30) == 0)
    assert np.isnan(tables.accuracy.sel(pulse_width=30)).all()
    for row in (row for row in rows_of(tmp_path) if row["frame_count"]):
        lost = row["pulse_width_ns"] == "30.0"
        assert (row["points_below_bound"] == "") == (lost or row["classifier"] == "mnn")
        assert (row["percent_correct"] == "") == (lost and row["classifier"] == "likelihood")
