"""Fusion of profile and silhouette gives the answers computed by hand on synthetic views."""

import numpy as np
import pytest
from range_channel import (
    ASPECTS,
    FRAMES,
    REPLICATES,
    SHIPS,
    bands,
    learned,
    made,
    rows_of_densities,
)
from scipy.special import logsumexp

from ncti.classify.blocks import row_blocks
from ncti.classify.calibration import fit_held_out_phases
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
def test_answers_match_an_independent_computation(unknown):
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
    known = np.flatnonzero(training_views)
    ship_aspect = np.divmod(known, len(ASPECTS))
    for m in range(len(LOOKS)):
        fitted = fit_held_out_phases(cosines[m][:, known][..., known], *ship_aspect)
        np.testing.assert_allclose(constants[m], fitted, rtol=1e-3)  # single precision
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


def test_blockwise_answers_equal_those_of_all_views_at_once(monkeypatch):
    """One ship is not learned, and some views are missing."""
    cell, (templates, silhouettes) = made(noise=5.0).without([0], [3]), maps()
    valid = np.ones((PHASES, *GRID), dtype=bool)
    valid[1, 2, 2] = False

    def found():
        return answered(cell, templates, silhouettes, valid, unknown=("b",))[0]

    expected = found()
    monkeypatch.setattr(fusion, "row_blocks", lambda count, most=0: row_blocks(count, 2))
    rows = rows_of_densities(monkeypatch)
    for name, values in found().items():
        # Inverse temperatures have relative errors of 1e-4, from scores in single precision.
        np.testing.assert_allclose(values, expected[name], rtol=1e-3, atol=1e-3, err_msg=name)
    assert (expected["cell"] == 0).sum() == 2 * 3 * PHASES * len(GAINS) * len(FRAMES) * len(LOOKS)
    assert max(rows) == 2 * REPLICATES
