"""Profile and silhouette together: by hand on made-up views, and on ships at sea."""

import numpy as np
import pytest
from range_channel import (
    ASPECTS,
    FRAMES,
    REPLICATES,
    SHIPS,
    bands,
    few_learned,
    learned,
    made,
    peak_memory,
)
from scipy.optimize import minimize
from scipy.special import logsumexp

from ncti.classify.blocks import row_blocks
from sweeps.stages import fusion
from sweeps.stages.likelihood import Prior, profile_moments, profile_templates

GRID = (SHIPS, len(ASPECTS))
VIEWS = SHIPS * len(ASPECTS)
PHASES, LOOKS = 4, (4, 16)
PROFILE_OUTLIERS = 0.1
GAINS, LOADING, VARIANCE = (0.0, 0.7), 0.02, 25.0
PRIOR = Prior(LOADING, 1.0, floor_estimated=False)
SHIP = np.repeat(np.arange(SHIPS), len(ASPECTS))


def maps():
    """Maps of templates whose phases differ, and of silhouettes of two numbers of frames."""
    rng = np.random.default_rng(1)
    one = (*GRID, 4, 3)
    templates = 120 * rng.random((1, *one)) + 50 * rng.random((PHASES, *one))
    noise = np.array([80.0, 45.0]).reshape(-1, 1, 1, 1, 1, 1)
    seen = templates + noise * rng.standard_normal((len(LOOKS), PHASES, *one))
    seen = np.clip(seen, 0, 255)
    seen[1, 1, 0, 2] = 0  # an empty one
    return templates.astype(np.uint8), seen.astype(np.uint8)


def one_of_each(values):
    """Arrays by number of frames with axes of other settings of silhouettes, of one value each."""
    return values.reshape(len(values), *(1 for _ in fusion.LOOKS[1:]), *values.shape[1:])


def answered(cell, templates, seen, valid=None, **training_views):
    """Answers (gain, count, look, channel, draw, ship, aspect); scores of profiles; constants."""
    valid = np.ones((PHASES, *GRID), dtype=bool) if valid is None else valid
    known = learned(**training_views)
    views = cell.valid[None], known, np.zeros_like(known), ASPECTS
    moments = profile_moments(cell.expected[None], bands(cell, VARIANCE), *views, PRIOR)
    of_profiles = profile_templates(moments, np.array(0.0))  # exact, as by hand
    constants = fusion.silhouette_constants(templates, seen, valid, known)
    averaged = cell.averaged.swapaxes(0, 1)
    outliers = np.full((len(GAINS), len(FRAMES), of_profiles[1].sum()), PROFILE_OUTLIERS)
    both = np.broadcast_to(valid & cell.valid, (REPLICATES, *valid.shape))
    looks = one_of_each(seen), one_of_each(constants)
    given = of_profiles, outliers, averaged, templates[None, None], *looks, both
    found = fusion.fusion(*given, known, PRIOR, GAINS, FRAMES)
    return (
        {name: values[:, :, :, 0, 0, 0, 0] for name, values in found.items()},
        of_profiles[0],
        constants,
    )


def similarity_by_hand(templates, seen):
    """(count, phase, view, template) largest cosine to a template in the other phases."""
    known = templates.reshape(PHASES, VIEWS, -1).astype(np.float64)
    shown = seen.reshape(len(LOOKS), PHASES, VIEWS, -1).astype(np.float64)
    length = np.linalg.norm(known, axis=-1)
    best = np.zeros((len(LOOKS), PHASES, VIEWS, VIEWS))
    for m, p, view, template in np.ndindex(best.shape):
        one = shown[m, p, view]
        if one.any():
            best[m, p, view, template] = max(
                one @ known[other, template] / np.linalg.norm(one) / length[other, template]
                for other in range(PHASES)
                if other != p
            )
    return best


def posterior_by_hand(scores, training_views):
    """(..., ship) probabilities of rows of scores: the mean density of a ship's templates."""
    of_ship = np.full((*scores.shape[:-1], SHIPS), -np.inf)
    for s in np.unique(SHIP[training_views]):
        own = scores[..., training_views & (s == SHIP)]
        of_ship[..., s] = logsumexp(own, axis=-1) - np.log(own.shape[-1])
    return np.exp(of_ship - logsumexp(of_ship, axis=-1, keepdims=True))


def loss_by_hand(scores, training_views, phase, inverse_temperature, outlier_fraction):
    """Negative log-likelihood of the ships of the other phases' silhouettes.

    Each counts 11/12 with the templates of its own aspect, and 1/12 without; one right and one
    wrong answer are added.
    """
    others = np.arange(PHASES) != phase
    place = np.arange(VIEWS) % len(ASPECTS)
    without = np.where(place[:, None] == place, -1, scores)
    rows = np.stack([one[others][:, training_views] for one in (scores, without)])
    true = np.broadcast_to(SHIP[training_views], rows.shape[:-1])[..., None]
    ships = len(np.unique(SHIP[training_views]))
    posterior = posterior_by_hand(inverse_temperature * rows, training_views)
    sure = (1 - outlier_fraction) * np.take_along_axis(
        posterior, true, -1
    ) + outlier_fraction / ships
    said = np.log(sure).sum(axis=(1, 2, 3)) @ [11 / 12, 1 / 12]
    return -(
        said
        + np.log(1 - outlier_fraction + outlier_fraction / ships)
        + np.log(outlier_fraction / ships)
    )


def is_likeliest(scores, training_views, phase, constants):
    """Whether no other inverse temperature and outlier fraction make more of the ships."""

    def negative_log_likelihood(both):
        of_phase = scores, training_views, phase, np.exp(both[0]), 1 / (1 + np.exp(-both[1]))
        return loss_by_hand(*of_phase)

    found = loss_by_hand(scores, training_views, phase, *constants)
    starts = [
        (np.log(inverse_temperature), start)
        for inverse_temperature in (3, 30, 300)
        for start in (-2, 1)
    ]
    other = min(minimize(negative_log_likelihood, x, method="Nelder-Mead").fun for x in starts)
    return found <= other + 1e-4  # where the searches stop


def with_outliers_by_hand(scores, training_views, outlier_fraction):
    """(..., template) logarithms of densities relative to their mean over ships, with outliers."""
    ships = np.unique(SHIP[training_views])
    own = [scores[..., training_views & (s == SHIP)] for s in ships]
    means = np.stack([logsumexp(one, axis=-1) - np.log(one.shape[-1]) for one in own])
    mean = logsumexp(means, axis=0) - np.log(len(ships))
    return np.log((1 - outlier_fraction) * np.exp(scores - mean[..., None]) + outlier_fraction)


@pytest.mark.parametrize("unknown", [None, ("b",)])
def test_by_hand(unknown):
    """Every gain, number of frames and draw; a ship that is learned, or is not."""
    training_views = np.ones(VIEWS, dtype=bool) if unknown is None else SHIP != 1
    cell, (templates, seen) = made(noise=5.0), maps()
    answers, of_profiles, constants = answered(cell, templates, seen, unknown=unknown)
    cosines = similarity_by_hand(templates, seen)
    # `test_likelihood_answers` holds these against densities.
    logs = np.full((len(GAINS), REPLICATES, len(FRAMES), VIEWS, VIEWS), np.nan)
    for r, n in np.ndindex(REPLICATES, len(FRAMES)):
        flat = cell.averaged[r, n].reshape(VIEWS, -1)
        logs[:, r, n][..., training_views] = of_profiles.log_likelihood(
            flat, FRAMES[n], gain_sigma=GAINS
        )
    for phase in range(PHASES):
        m = phase % len(LOOKS)
        assert is_likeliest(cosines[m], training_views, phase, constants[m][:, phase])
    doubtful = []
    for g, m, n in np.ndindex(len(GAINS), len(LOOKS), len(FRAMES)):
        found = {name: values[g, n, m] for name, values in answers.items()}
        assert found["predicted"].shape == (3, PHASES, *GRID)
        np.testing.assert_array_equal(found["inverse_temperature"][0], 1)
        np.testing.assert_array_equal(found["inverse_temperature"][1:], constants[m][[0, 0]])
        calm = np.full(PHASES, PROFILE_OUTLIERS)
        np.testing.assert_allclose(
            found["outlier_fraction"], [calm, constants[m][1], calm], rtol=1e-15
        )
        for d in range(PHASES):
            profile = logs[g, d % REPLICATES, n]
            inverse_temperature, outlier_fraction = constants[m][:, d]
            silhouette = with_outliers_by_hand(
                inverse_temperature * cosines[m, d], training_views, outlier_fraction
            )
            both = with_outliers_by_hand(profile, training_views, PROFILE_OUTLIERS) + silhouette
            for c, alone in enumerate((profile, silhouette, both)):
                wanted = posterior_by_hand(alone, training_views)
                true = wanted[np.arange(VIEWS), SHIP]
                # Of an inverse temperature that is off by 2e-4, times scores that differ by some
                # 20.
                np.testing.assert_allclose(found["probability"][c, d].ravel(), true, atol=4e-3)
                named = found["predicted"][c, d].ravel()
                clear = np.diff(np.sort(wanted), axis=1)[:, -1] > 1e-2
                np.testing.assert_array_equal(named[clear], wanted.argmax(axis=1)[clear])
                np.testing.assert_array_equal(found["correct"][c, d].ravel(), named == SHIP)
                doubtful.append((wanted.max(axis=1) > 0.05) & (wanted.max(axis=1) < 0.95))
        np.testing.assert_array_equal(found["cell"], 1)
    assert np.mean(doubtful) > 0.2


@pytest.mark.parametrize("rows", [2, 6])
def test_answers_in_blocks_are_those_of_all_views(rows, monkeypatch):
    """With a ship that is not learned, and views that are missing."""
    cell, (templates, seen) = made(noise=5.0).without([0], [3]), maps()
    valid = np.ones((PHASES, *GRID), dtype=bool)
    valid[1, 2, 2] = False

    def found():
        return answered(cell, templates, seen, valid, unknown=("b",))[0]

    whole = found()
    monkeypatch.setattr(fusion, "row_blocks", lambda count, most=0: row_blocks(count, rows))
    for name, values in found().items():
        # Inverse temperatures are found to 1e-4 of theirs, from scores in single precision.
        np.testing.assert_allclose(values, whole[name], rtol=1e-3, atol=1e-3, err_msg=name)
    assert (whole["cell"] == 0).sum() == 2 * 3 * PHASES * len(GAINS) * len(FRAMES) * len(LOOKS)


def test_views_that_are_only_tested_cost_no_memory_but_their_own(monkeypatch):
    monkeypatch.setattr(fusion, "HELD_ROWS", 192)

    def peak(aspects):
        known, templates, averaged = few_learned(aspects)
        maps = np.random.default_rng(0).integers(0, 255, (2, *known.shape, 4, 3)).astype(np.uint8)
        valid = np.ones((2, *known.shape), dtype=bool)

        def answer():
            constants = fusion.silhouette_constants(maps, maps[None], valid, known)
            outliers = np.full((1, 1, known.sum()), 0.1)
            looks = maps[None, None], one_of_each(maps[None]), one_of_each(constants)
            sensors = templates, outliers, averaged[None, None], *looks
            fusion.fusion(*sensors, valid[None], known, PRIOR, (1.0,), (4,))

        return peak_memory(answer)

    peak(20)  # imports
    # Four times as many tests, whose scores would be 3 MB more.
    assert peak(800) < 1.5 * peak(200)
