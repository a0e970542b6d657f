"""Nearest neighbours by correlation on profiles made up, against answers by hand."""

from itertools import product

import numpy as np
import pytest
from range_channel import BINS, FLOOR, FRAMES, REPLICATES, directions, learned, made

from sweeps.stages import correlation

BOTH = (False, True)


def answered(cell, training="expected", left_out=(False,), frames=0, **training_views):
    """Answers of all replicates, (replicate, left_out, ship, aspect)."""
    ships, aspects = cell.valid.shape
    draws = correlation.profile_draws(cell.averaged[:, frames])
    found = [
        correlation.correlation(
            draws,
            learned(**training_views)[:ships, :aspects],
            cell.expected,
            cell.averaged[replicate, frames],
            cell.valid,
            replicate,
            training,
            leave,
        )
        for replicate, leave in product(range(len(cell.averaged)), left_out)
    ]
    shape = len(cell.averaged), len(left_out), ships, aspects
    return {name: np.stack([one[name] for one in found]).reshape(shape) for name in found[0]}


@pytest.mark.parametrize(("training", "frames"), list(product(("expected", "noisy"), range(2))))
def test_it_is_the_most_similar_profile(training, frames):
    cell = made(noise=5.0)
    answers = answered(cell, training, BOTH, frames)
    tests, expected = directions(cell.averaged[:, frames]), directions(cell.expected)
    for replicate, ship, aspect in np.ndindex(REPLICATES, *cell.valid.shape):
        training_set = {
            "expected": expected[None],
            "noisy": np.delete(tests, replicate, axis=0),
        }[training]
        cosines = training_set @ tests[replicate, ship, aspect]
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


@pytest.mark.parametrize("training", ["expected", "noisy"])
def test_views_that_are_not_learned_are_named_alone(training):
    cell = made()
    untrained = np.zeros_like(cell.valid)
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


def test_a_flat_profile_that_was_learned_answers_for_none():
    """Its cosine of 0 is more than those of profiles that are opposite."""
    cell = made()
    expected = np.full((2, 1, BINS), FLOOR, dtype=np.float32)
    expected[1, 0, 20:30] += 1
    test = np.full(BINS, FLOOR, dtype=np.float32)
    test[40], test[20:30] = FLOOR + 1, FLOOR - 0.5
    averaged = np.broadcast_to(test, (1, len(FRAMES), 2, 1, BINS))
    valid = np.ones((2, 1), dtype=bool)
    answers = answered(cell.changed(expected=expected, averaged=averaged, valid=valid))
    assert answers["predicted"].ravel().tolist() == [1, 1]
    # (-0.5 * 10) / (sqrt(10) sqrt(1 + 10 / 4))
    np.testing.assert_allclose(answers["similarity"], -5 / np.sqrt(35), rtol=1e-6)
