"""What is learned, and tables of percent correct, counted by hand."""

import numpy as np
import pytest
import xarray as xr
from range_channel import EXPERIMENT, choose

from ncti.evaluate import replicated_accuracy, wilson_interval
from sweeps.engine.errors import ConfigurationError
from sweeps.stages import classifier
from sweeps.stages.classifier import tabulate_answers, training_views

GRID = {"grid__ship": ["duncan", "horne", "texas"], "grid__aspect": [0, 15, 45]}


def test_everything_is_learned_unless_told_otherwise():
    assert classifier.learned_of(choose(**GRID)).all()


def test_unknown_ships_and_aspects_between_are_not_learned():
    choices = choose(**GRID, classifier__unknown="horne", classifier__training_aspect=[45, 0])
    wanted = [[1, 0, 1], [0, 0, 0], [1, 0, 1]]
    np.testing.assert_array_equal(classifier.learned_of(choices), wanted)
    views = training_views(("a", "b"), (0.0, 1.5), ("b",), None, None)
    np.testing.assert_array_equal(views, [[1, 1], [0, 0]])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"classifier__unknown": "connole"},
            r"^classifier\.unknown has 'connole', .* one of duncan, horne, texas, the values of "
            r"grid\.ship$",
        ),
        ({"classifier__unknown": GRID["grid__ship"]}, r"^classifier\.unknown has every ship"),
        (
            {"classifier__unknown": ["duncan", "duncan"]},
            r"^classifier\.unknown has 'duncan' more than once",
        ),
        ({"classifier__unknown": 3}, r"^classifier\.unknown is 3"),
        (
            {"classifier__training_aspect": 2},
            r"^classifier\.training_aspect has 2, .* one of grid\.aspect$",
        ),
        ({"classifier__training_aspect": []}, r"^classifier\.training_aspect is empty"),
        ({"classifier__training_aspect": float("nan")}, r"^classifier\.training_aspect has nan"),
        ({"classifier__name": "nobody"}, r"^classifier\.name has 'nobody', .* acn, mnn, "),
    ],
)
def test_invalid_choices_are_refused(given, said):
    with pytest.raises(ConfigurationError, match=said):
        classifier.check(choose(**GRID, **given))


def test_what_is_known_by_its_key_is_a_setting():
    (receiver,) = (one for one in EXPERIMENT.declared if one.key == classifier.RECEIVER)
    assert receiver.default == classifier.FULL


def test_a_classifier_is_there_if_it_is_chosen_and_the_sensor_looks():
    there = classifier.names_by("mnn", "range")
    assert there(choose(classifier__name=["acn", "mnn"], sensor="both"))
    assert not there(choose(classifier__name="acn"))
    assert not there(choose(classifier__name="mnn", sensor="infrared"))


def answers(**arrays):
    """Answers about three ships at three aspects."""
    dims = {2: ("ship", "aspect"), 3: ("replicate", "ship", "aspect")}
    return xr.Dataset(
        {name: (dims[np.ndim(values)], values) for name, values in arrays.items()},
        {"ship": ["duncan", "horne", "texas"], "aspect": [0.0, 15.0, 45.0]},
    )


def test_fractions_are_counted_by_hand():
    """The second ship is unknown, and a view of the third is lost."""
    correct = np.array([[1, 0, 1], [0, 0, 0], [1, -1, 0]])
    trained = np.array([[1, 1, 0], [-1, -1, -1], [1, 1, 1]])
    choices = choose(**GRID, classifier__unknown="horne")
    table = tabulate_answers(answers(correct=correct, training_correct=trained), choices)
    assert list(table.aspect_bin.values) == ["0-15", "45", "overall"]
    np.testing.assert_array_equal(table.aspect_low, [0, 45, np.nan])
    np.testing.assert_array_equal(table.n, [3, 2, 5])
    np.testing.assert_allclose(table.accuracy, [2 / 3, 1 / 2, 3 / 5])
    low, high = wilson_interval([2, 1, 3], [3, 2, 5])
    np.testing.assert_allclose(table.ci_low, low)
    np.testing.assert_allclose(table.ci_high, high)
    np.testing.assert_array_equal(table.training_n, [4, 2, 6])
    np.testing.assert_allclose(table.training_accuracy, [1, 1 / 2, 5 / 6])
    assert "ship_accuracy" not in table and "category_count" not in table
    assert table.attrs == {"receiver": "full_profile"}
    for name, array in table.data_vars.items():
        assert array.attrs["units"] == "1" and array.attrs["long_name"], name


def test_several_receivers_are_an_axis_and_no_attribute():
    choices = choose(**GRID, ladar__receiver=["full_profile", "peak_pulse"])
    assert tabulate_answers(answers(correct=np.ones((3, 3), int)), choices).attrs == {}


def test_replicates_are_pooled_as_they_differ():
    rng = np.random.default_rng(0)
    correct = rng.integers(0, 2, (4, 3, 3))
    table = tabulate_answers(answers(correct=correct), choose(**GRID))
    wanted = replicated_accuracy(correct == 1, np.array([0.0, 15.0, 45.0]))
    np.testing.assert_array_equal(table.accuracy, wanted.fraction)
    np.testing.assert_array_equal(table.ci_low, wanted.ci_low)
    assert "replicate" not in table.coords and (table.n == [24, 12, 36]).all()


def test_categories_are_counted():
    category = np.array([[0, 1, 1], [-1, -1, -1], [2, 2, 0]])
    given = answers(correct=np.ones((3, 3), int), training_category=category)
    for passes, settled in ((4, 1), (-4, 0)):
        choices = choose(**GRID, classifier__unknown="horne")
        table = tabulate_answers(given.assign(passes=passes), choices)
        assert (table.category_count, table.view_count, table.settled) == (3, 6, settled)
