"""Nearest neighbours by correlation on profiles made up, against answers by hand."""

from itertools import product

import numpy as np
import pytest
from range_channel import BINS, FLOOR, FRAMES, REPLICATES, choose, directions, learned, made

from sweeps.engine.errors import ConfigurationError
from sweeps.stages import correlation

BOTH = (False, True)


def answered(cell, training="expected", left_out=(False,), frames=0, **training_views):
    """Answers of all replicates, (replicate, left_out, ship, aspect)."""
    ships, aspects = cell.there.shape
    draws = correlation.profile_draws(cell.averaged[:, frames])
    found = [
        correlation.correlation(
            draws,
            learned(**training_views)[:ships, :aspects],
            cell.expected,
            cell.averaged[replicate, frames],
            cell.there,
            replicate,
            training,
            left_out,
        )
        for replicate in range(len(cell.averaged))
    ]
    return {name: np.stack([one[name] for one in found]) for name in found[0]}


@pytest.mark.parametrize(("training", "frames"), list(product(("expected", "noisy"), range(2))))
def test_it_is_the_most_similar_profile(training, frames):
    cell = made(noise=5.0)
    answers = answered(cell, training, BOTH, frames)
    tests, expected = directions(cell.averaged[:, frames]), directions(cell.expected)
    for replicate, ship, aspect in np.ndindex(REPLICATES, *cell.there.shape):
        lessons = {
            "expected": expected[None],
            "noisy": np.delete(tests, replicate, axis=0),
        }[training]
        cosines = lessons @ tests[replicate, ship, aspect]
        for j, left_out in enumerate(BOTH):
            if left_out:
                cosines[:, :, aspect] = -2
            _, name, _ = np.unravel_index(cosines.argmax(), cosines.shape)
            place = (replicate, j, ship, aspect)
            assert answers["predicted"][place] == name
            assert answers["correct"][place] == (name == ship)
            assert answers["similarity"][place] == pytest.approx(cosines.max(), abs=1e-7)
    # Neither all right nor all wrong: a wrong rule would show.
    for j in range(2):
        assert 0 < answers["correct"][:, j].mean() < 1


@pytest.mark.parametrize("training", ["expected", "noisy"])
def test_an_answer_does_not_depend_on_whether_others_leave_out(training):
    cell = made(noise=3.0)
    whole = answered(cell, training, BOTH)
    for j, left_out in enumerate(BOTH):
        for name, values in answered(cell, training, (left_out,)).items():
            np.testing.assert_array_equal(values[:, 0], whole[name][:, j], err_msg=name)


def test_the_draw_that_is_tested_is_not_learned():
    cell = made(noise=3.0)
    before = answered(cell, "noisy")
    assert before["similarity"].max() < 0.99
    # The tested replicate in place of another: every view finds itself.
    averaged = cell.averaged.copy()
    averaged[1] = averaged[0]
    after = answered(cell.changed(averaged=averaged), "noisy")
    np.testing.assert_allclose(after["similarity"][:2], 1, atol=1e-12)
    assert after["correct"][:2].all()


def test_expected_profiles_are_learned_whatever_the_other_draws():
    cell = made(noise=3.0)
    averaged = cell.averaged.copy()
    averaged[1:] = averaged[1:, ..., ::-1]
    before, after = answered(cell), answered(cell.changed(averaged=averaged))
    for name, values in before.items():
        np.testing.assert_array_equal(after[name][0], values[0], err_msg=name)


@pytest.mark.parametrize("training", ["expected", "noisy"])
def test_views_that_are_not_learned_are_named_alone(training):
    cell = made()
    untrained = np.zeros_like(cell.there)
    untrained[2] = untrained[:, 1] = True
    training_views = {"unknown": ("c",), "training_aspect": (0.0, 30.0, 59.9, 60.0, 90.0)}
    before = answered(cell, training, BOTH, **training_views)
    expected, averaged = cell.expected.copy(), cell.averaged.copy()
    expected[untrained] = expected[untrained][:, ::-1]
    averaged[1:, :, untrained] = averaged[1:, :, untrained][..., ::-1]
    after = answered(
        cell.changed(expected=expected, averaged=averaged), training, BOTH, **training_views
    )
    for name, values in before.items():
        np.testing.assert_array_equal(after[name][0], values[0], err_msg=name)
    assert set(np.unique(before["predicted"])) == {0, 1}
    assert before["correct"][:, 0, ~untrained].all()


@pytest.mark.parametrize("training", ["expected", "noisy"])
def test_of_equal_profiles_the_first_ship_answers(training):
    """Ship 2 looks like ship 0 to all bits; products round as their places in a matrix have it."""
    cell = made(noise=3.0)
    expected, averaged = cell.expected.copy(), cell.averaged.copy()
    expected[2], averaged[:, :, 2] = expected[0], averaged[:, :, 0]
    answers = answered(cell.changed(expected=expected, averaged=averaged), training)
    assert set(np.unique(answers["predicted"])) == {0, 1}


def test_a_flat_profile_names_no_ship():
    cell = made()
    averaged = cell.averaged.copy()
    averaged[0, 0, 0, 4] = 7.0
    answers = answered(cell.changed(averaged=averaged))
    found = [answers[name][0, 0, 0, 4] for name in ("predicted", "correct", "similarity", "cell")]
    assert found == [-1, 0, 0, 1]
    others = np.ones_like(answers["correct"], dtype=bool)
    others[0, 0, 0, 4] = False
    assert answers["correct"][others].all()


def test_a_flat_profile_that_was_learned_answers_for_none():
    """Its cosine of 0 is more than those of profiles that are opposite."""
    cell = made()
    expected = np.full((2, 1, BINS), FLOOR, dtype=np.float32)
    expected[1, 0, 20:30] += 1
    test = np.full(BINS, FLOOR, dtype=np.float32)
    test[40], test[20:30] = FLOOR + 1, FLOOR - 0.5
    averaged = np.broadcast_to(test, (1, len(FRAMES), 2, 1, BINS))
    there = np.ones((2, 1), dtype=bool)
    answers = answered(cell.changed(expected=expected, averaged=averaged, there=there))
    assert answers["predicted"].ravel().tolist() == [1, 1]
    # (-0.5 * 10) / (sqrt(10) sqrt(1 + 10 / 4))
    np.testing.assert_allclose(answers["similarity"], -5 / np.sqrt(35), rtol=1e-6)


@pytest.mark.parametrize("training", ["expected", "noisy"])
def test_views_that_are_not_there_change_no_other_answer(training):
    """Answers are those of a grid that never had them."""
    cell = made(noise=1.0)
    found = answered(cell.without(2, slice(None)), training, BOTH)
    smaller = cell.changed(
        expected=cell.expected[:2], averaged=cell.averaged[:, :, :2], there=cell.there[:2]
    )
    for name, values in answered(smaller, training, BOTH).items():
        np.testing.assert_allclose(found[name][:, :, :2], values, atol=1e-12, err_msg=name)
    for name in ("predicted", "correct"):
        assert (found[name][:, :, 2] == -1).all()
    assert np.isnan(found["similarity"][:, :, 2]).all()
    assert (found["cell"][:, :, 2] == 0).all()


def test_one_aspect_cannot_be_left_out():
    """Neither where no other is there, nor where no other is learned."""
    cell = made()
    alone = cell.without(slice(None), [0, 1, 3, 4, 5])
    for given, training_views in ((alone, {}), (cell, {"training_aspect": (30.0,)})):
        with pytest.raises(ValueError, match=r"^classifier\.left_out has True, but must be "):
            answered(given, left_out=BOTH, **training_views)
        assert answered(given, **training_views)["correct"][..., 2].all()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"classifier__training": "noisy"},
            "grid.replicate is 1, but must be at least 2 where classifier.training has noisy: what "
            "is learned must not be what is tested",
        ),
        (
            {"classifier__left_out": [False, True], "classifier__training_aspect": 3},
            "classifier.left_out has True, but must be false where 1 aspect is learned: nothing "
            "would be left",
        ),
    ],
)
def test_what_makes_no_sense_together_is_refused(given, said):
    with pytest.raises(ConfigurationError) as error:
        correlation.check(choose(classifier__name="correlation", **given))
    assert str(error.value) == said
    # Settings of a classifier that names nothing are left alone.
    correlation.check(choose(classifier__name="acn", **given))
    correlation.check(choose(classifier__name="correlation", sensor="infrared", **given))
