"""Fusion of profile and silhouette gives the answers computed by hand on synthetic views."""

import numpy as np
import pytest
from memory import peak_memory
from range_channel import (
    ASPECTS,
    FRAMES,
    REPLICATES,
    SHIPS,
    bands,
    few_learned,
    learned,
    made,
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
    """Return maps of templates that differ by phase, and of silhouettes of two frame counts."""
    rng = np.random.default_rng(1)
    shape = (*GRID, 4, 3)
    templates = 120 * rng.random((1, *shape)) + 50 * rng.random((PHASES, *shape))
    noise = np.array([80.0, 45.0]).reshape(-1, 1, 1, 1, 1, 1)
    silhouettes = templates + noise * rng.standard_normal((len(LOOKS), PHASES, *shape))
    silhouettes = np.clip(silhouettes, 0, 255)
    silhouettes[1, 1, 0, 2] = 0  # an empty one
    return templates.astype(np.uint8), silhouettes.astype(np.uint8)


def one_of_each(values):
    """Return arrays by number of frames, with axes of one value for other silhouette settings."""
    return values.reshape(len(values), *(1 for _ in fusion.LOOKS[1:]), *values.shape[1:])


def answered(cell, templates, silhouettes, valid=None, **training_views):
    """Return answers (gain, count, look, channel, draw, ship, aspect), templates and constants."""
    valid = np.ones((PHASES, *GRID), dtype=bool) if valid is None else valid
    known = learned(**training_views)
    views = cell.valid[None], known, np.zeros_like(known), ASPECTS
    moments = profile_moments(cell.expected[None], bands(cell, VARIANCE), *views, PRIOR)
    of_profiles = profile_templates(moments, np.array(0.0))  # exact, as by hand
    constants = fusion.silhouette_constants(templates, silhouettes, valid, known)
    averaged = cell.averaged.swapaxes(0, 1)
    outliers = np.full((len(GAINS), len(FRAMES), of_profiles[1].sum()), PROFILE_OUTLIERS)
    valid_in_both = np.broadcast_to(valid & cell.valid, (REPLICATES, *valid.shape))
    looks = one_of_each(silhouettes), one_of_each(constants)
    inputs = of_profiles, outliers, averaged, templates[None, None], *looks, valid_in_both
    answers = fusion.fusion(*inputs, known, PRIOR, GAINS, FRAMES)
    return (
        {name: values[:, :, :, 0, 0, 0, 0] for name, values in answers.items()},
        of_profiles[0],
        constants,
    )


def similarity_by_hand(templates, silhouettes):
    """Return the largest cosine to a template in other phases, (count, phase, view, template)."""
    known = templates.reshape(PHASES, VIEWS, -1).astype(np.float64)
    vectors = silhouettes.reshape(len(LOOKS), PHASES, VIEWS, -1).astype(np.float64)
    length = np.linalg.norm(known, axis=-1)
    best = np.zeros((len(LOOKS), PHASES, VIEWS, VIEWS))
    for m, p, view, template in np.ndindex(best.shape):
        vector = vectors[m, p, view]
        if vector.any():
            best[m, p, view, template] = max(
                vector @ known[other, template] / np.linalg.norm(vector) / length[other, template]
                for other in range(PHASES)
                if other != p
            )
    return best


def posterior_by_hand(scores, training_views):
    """Return (..., ship) probabilities of scores, by the mean density of a ship's templates."""
    of_ship = np.full((*scores.shape[:-1], SHIPS), -np.inf)
    for s in np.unique(SHIP[training_views]):
        densities = scores[..., training_views & (s == SHIP)]
        of_ship[..., s] = logsumexp(densities, axis=-1) - np.log(densities.shape[-1])
    return np.exp(of_ship - logsumexp(of_ship, axis=-1, keepdims=True))


def loss_by_hand(scores, training_views, phase, inverse_temperature, outlier_fraction):
    """Return the negative log-likelihood of the ships of the other phases' silhouettes.

    Each counts 11/12 with the templates of its own aspect, and 1/12 without; one right and one
    wrong answer are added.
    """
    other_phases = np.arange(PHASES) != phase
    column = np.arange(VIEWS) % len(ASPECTS)
    without = np.where(column[:, None] == column, -1, scores)
    rows = np.stack([rows_of[other_phases][:, training_views] for rows_of in (scores, without)])
    true = np.broadcast_to(SHIP[training_views], rows.shape[:-1])[..., None]
    ships = len(np.unique(SHIP[training_views]))
    posterior = posterior_by_hand(inverse_temperature * rows, training_views)
    sure = (1 - outlier_fraction) * np.take_along_axis(
        posterior, true, -1
    ) + outlier_fraction / ships
    log_likelihood = np.log(sure).sum(axis=(1, 2, 3)) @ [11 / 12, 1 / 12]
    return -(
        log_likelihood
        + np.log(1 - outlier_fraction + outlier_fraction / ships)
        + np.log(outlier_fraction / ships)
    )


def is_likeliest(scores, training_views, phase, constants):
    """Return whether no other inverse temperature and outlier fraction are more likely."""

    def negative_log_likelihood(parameters):
        of_phase = (
            scores,
            training_views,
            phase,
            np.exp(parameters[0]),
            1 / (1 + np.exp(-parameters[1])),
        )
        return loss_by_hand(*of_phase)

    loss = loss_by_hand(scores, training_views, phase, *constants)
    starts = [
        (np.log(inverse_temperature), start)
        for inverse_temperature in (3, 30, 300)
        for start in (-2, 1)
    ]
    least = min(minimize(negative_log_likelihood, x, method="Nelder-Mead").fun for x in starts)
    return loss <= least + 1e-4  # where the searches stop


def with_outliers_by_hand(scores, training_views, outlier_fraction):
    """Return (..., template) log densities relative to their mean over ships, with outliers."""
    ships = np.unique(SHIP[training_views])
    by_ship = [scores[..., training_views & (s == SHIP)] for s in ships]
    means = np.stack(
        [logsumexp(densities, axis=-1) - np.log(densities.shape[-1]) for densities in by_ship]
    )
    mean = logsumexp(means, axis=0) - np.log(len(ships))
    return np.log((1 - outlier_fraction) * np.exp(scores - mean[..., None]) + outlier_fraction)


@pytest.mark.parametrize("unknown", [None, ("b",)])
def test_by_hand(unknown):
    """It holds for every gain, number of frames and draw, with or without a ship not learned."""
    training_views = np.ones(VIEWS, dtype=bool) if unknown is None else SHIP != 1
    cell, (templates, silhouettes) = made(noise=5.0), maps()
    answers, of_profiles, constants = answered(cell, templates, silhouettes, unknown=unknown)
    cosines = similarity_by_hand(templates, silhouettes)
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
        answers_here = {name: values[g, n, m] for name, values in answers.items()}
        assert answers_here["predicted"].shape == (3, PHASES, *GRID)
        np.testing.assert_array_equal(answers_here["inverse_temperature"][0], 1)
        np.testing.assert_array_equal(answers_here["inverse_temperature"][1:], constants[m][[0, 0]])
        calm = np.full(PHASES, PROFILE_OUTLIERS)
        np.testing.assert_allclose(
            answers_here["outlier_fraction"], [calm, constants[m][1], calm], rtol=1e-15
        )
        for d in range(PHASES):
            profile = logs[g, d % REPLICATES, n]
            inverse_temperature, outlier_fraction = constants[m][:, d]
            silhouette = with_outliers_by_hand(
                inverse_temperature * cosines[m, d], training_views, outlier_fraction
            )
            both = with_outliers_by_hand(profile, training_views, PROFILE_OUTLIERS) + silhouette
            for c, densities in enumerate((profile, silhouette, both)):
                posterior = posterior_by_hand(densities, training_views)
                true = posterior[np.arange(VIEWS), SHIP]
                # The inverse temperature is off by 2e-4, and scores differ by some 20.
                np.testing.assert_allclose(
                    answers_here["probability"][c, d].ravel(), true, atol=4e-3
                )
                predicted = answers_here["predicted"][c, d].ravel()
                clear = np.diff(np.sort(posterior), axis=1)[:, -1] > 1e-2
                np.testing.assert_array_equal(predicted[clear], posterior.argmax(axis=1)[clear])
                np.testing.assert_array_equal(
                    answers_here["correct"][c, d].ravel(), predicted == SHIP
                )
                doubtful.append((posterior.max(axis=1) > 0.05) & (posterior.max(axis=1) < 0.95))
        np.testing.assert_array_equal(answers_here["cell"], 1)
    assert np.mean(doubtful) > 0.2


@pytest.mark.parametrize("rows", [2, 6])
def test_answers_in_blocks_are_those_of_all_views(rows, monkeypatch):
    """One ship is not learned, and some views are missing."""
    cell, (templates, silhouettes) = made(noise=5.0).without([0], [3]), maps()
    valid = np.ones((PHASES, *GRID), dtype=bool)
    valid[1, 2, 2] = False

    def found():
        return answered(cell, templates, silhouettes, valid, unknown=("b",))[0]

    expected = found()
    monkeypatch.setattr(fusion, "row_blocks", lambda count, most=0: row_blocks(count, rows))
    for name, values in found().items():
        # Inverse temperatures have relative errors of 1e-4, from scores in single precision.
        np.testing.assert_allclose(values, expected[name], rtol=1e-3, atol=1e-3, err_msg=name)
    assert (expected["cell"] == 0).sum() == 2 * 3 * PHASES * len(GAINS) * len(FRAMES) * len(LOOKS)


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
    # Scores of four times as many tests would take 3 MB more.
    assert peak(800) < 1.5 * peak(200)
