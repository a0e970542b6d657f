"""The correlation stage names the ship of the most similar profile learned."""

from itertools import product

import numpy as np
import pytest
from memory import peak_memory
from range_channel import REPLICATES, directions, learned, made

from sweeps.stages import classifier, correlation

BOTH = (False, True)


def answered(cell, training="expected", left_out=(False,), frames=0, **training_views):
    """Return answers of all replicates, (replicate, left_out, ship, aspect)."""
    ships, aspects = cell.valid.shape
    averaged = cell.averaged[:, frames]
    draws = correlation.profile_draws(averaged, np.isfinite(averaged).all(axis=-1), training)
    assert np.isfinite(draws).all()
    answers = [
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
    return {
        name: np.stack([answer[name] for answer in answers]).reshape(shape) for name in answers[0]
    }


@pytest.mark.parametrize(("training", "frames"), list(product(("expected", "noisy"), range(2))))
def test_answer_is_the_most_similar_profile(training, frames):
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
            index = (replicate, j, ship, aspect)
            assert answers["predicted"][index] == name
            assert answers["correct"][index] == (name == ship)
            assert answers["similarity"][index] == pytest.approx(cosines.max(), abs=1e-7)
    # Some answers are right and some are wrong, so that a wrong rule would show.
    for j in range(2):
        assert 0 < answers["correct"][:, j].mean() < 1


def test_leaving_out_the_only_aspect_is_refused():
    training = {"training_aspect": (30.0,)}
    with pytest.raises(ValueError, match=r"^classifier\.left_out has True"):
        answered(made(), left_out=(True,), **training)
    assert (answered(made(), left_out=(False,), **training)["predicted"] >= 0).all()


@pytest.mark.parametrize("training", ["expected", "noisy"])
def test_untrained_views_never_serve_as_templates(training):
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


def matched(aspects, learned_every):
    """Return the peak memory [B] of answers about three noisy ships, and check them by vectors."""
    rng = np.random.default_rng(aspects)
    expected = rng.standard_normal((3, aspects, 16)).astype(np.float32)
    averaged = expected + rng.standard_normal(expected.shape).astype(np.float32)
    valid = rng.random((3, aspects)) < 0.9
    expected[~valid] = averaged[~valid] = np.nan
    known = valid & (np.arange(aspects) % learned_every == 0)
    profiles = classifier.stack_views(expected)[None], classifier.stack_views(averaged)
    answers = {}

    def answer():
        see = classifier.to_vectors
        answers.update(correlation.match_views(*profiles, valid, known, True, to_vectors=see))

    peak_bytes = peak_memory(answer)
    vectors = (classifier.profile_vectors(expected)[None], classifier.profile_vectors(averaged))
    for name, values in correlation.match_views(*vectors, valid, known, True).items():
        np.testing.assert_array_equal(values, answers[name], err_msg=name)
    return peak_bytes


def test_memory_hardly_grows_with_untrained_test_views():
    small, large = (matched(600 * times, learned_every=times) for times in (1, 8))
    # For eight times the tests of as many templates: one block of cosines, some numbers a view.
    assert large < 1.5 * small


def test_zero_templates_give_no_answer():
    profiles = np.array([[[0.0, 0.0], [1.0, 0.0]]])
    valid, known = np.ones((1, 2), dtype=bool), np.array([[True, False]])
    answers = correlation.match_views(profiles, profiles[0], valid, known, left_out=False)
    assert answers["predicted"].tolist() == [[-1, -1]]
    assert answers["similarity"].tolist() == [[0.0, 0.0]]
    with pytest.raises(ValueError, match="only zero vectors"):
        correlation.match_views(0 * profiles, profiles[0], valid, known, left_out=False)


def test_tested_draw_is_excluded_from_training():
    cell = made(noise=3.0)
    before = answered(cell, "noisy")
    assert before["similarity"].max() < 0.99
    # The tested replicate in place of another: every view finds itself.
    averaged = cell.averaged.copy()
    averaged[1] = averaged[0]
    after = answered(cell.changed(averaged=averaged), "noisy")
    np.testing.assert_allclose(after["similarity"][:2], 1, atol=1e-12)
    assert after["correct"][:2].all()
