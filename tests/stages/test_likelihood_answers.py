"""Maximum likelihood on synthetic profiles gives the answers of densities by hand."""

import numpy as np
import pytest
from range_channel import (
    ASPECTS,
    BINS,
    FRAMES,
    NAMED,
    SHIPS,
    bands,
    dense,
    learned,
    made,
    rows_of_densities,
)
from scipy.special import expit, logsumexp
from scipy.stats import chi2, multivariate_normal, norm

from ncti.classify import GaussianTemplates
from ncti.classify.blocks import row_blocks
from sweeps.stages import likelihood

BOTH = (False, True)
GAINS = (0.0, 0.7)
ERRORS = (0.0, 0.2)


def templates_of(
    cell, covariance, diagonal_loading=1e-3, error=0.0, floor_sigma=1.0, **training_views
):
    """Return templates of learned views, exact by default as the densities by hand are."""
    known = learned(**training_views)[: len(cell.valid)]
    prior = likelihood.Prior(diagonal_loading, floor_sigma, floor_estimated=False)
    alternative = learned(**training_views)[: len(cell.valid)] & False
    moments = likelihood.profile_moments(
        cell.expected[None], covariance, cell.valid[None], known, alternative, ASPECTS, prior
    )
    rng = np.random.default_rng(0)
    calibrated = likelihood.calibrated_error(moments, template_error=error, rng=rng)
    return likelihood.profile_templates(moments, calibrated)


def scores(templates, averaged, gain, prior):
    """Return log densities (frame_count, view, template) of all views."""
    flat = averaged.reshape(len(FRAMES), -1, averaged.shape[-1])
    return np.stack(
        [
            templates[0].log_likelihood(prior.drop_floors(block), count, gain_sigma=gain)
            for count, block in zip(FRAMES, flat, strict=True)
        ]
    )


def answered(
    cell,
    gains=(1.0,),
    left_out=(False,),
    frames=FRAMES,
    replicate=0,
    diagonal_loading=1e-3,
    **arguments,
):
    sigma = arguments.pop("aspect_sigma", None)
    track = likelihood.track(NAMED, ASPECTS, sigma, replicate, 0)
    covariance = arguments.pop("covariance", None)
    covariance = bands(cell) if covariance is None else covariance
    templates = templates_of(cell, covariance, diagonal_loading, **arguments)
    averaged = cell.averaged[replicate, [FRAMES.index(count) for count in frames]]
    prior = likelihood.Prior(diagonal_loading, 1.0, floor_estimated=False)
    arguments = averaged, cell.valid
    alternatives = None, np.zeros_like(cell.valid)
    return likelihood.likelihood(
        *(templates, alternatives, *arguments, prior, track),
        ship=NAMED,
        misfit_weight=0.0,
        gain_sigma=gains,
        frame_count=frames,
        left_out=left_out,
    )


@pytest.mark.parametrize(("place", "gain"), list(enumerate(GAINS)))
def test_answers_match_an_independent_computation(place, gain):
    """Densities are Gaussian, with gain and floor as two more directions of the covariance.

    Each view has a floor of its own, which no gain changes.
    """
    cell = made(noise=5.0)
    floors = np.linspace(0, 5, cell.valid.size, dtype=np.float32).reshape(*cell.valid.shape, 1)
    cell = cell.changed(expected=cell.expected + floors, averaged=cell.averaged + floors)
    diagonal_loading, covariance = 0.02, bands(cell, variance=25.0)
    answers = answered(cell, GAINS, BOTH, diagonal_loading=diagonal_loading, covariance=covariance)
    variance = covariance[..., 0, :].mean(dtype=np.float64)
    shift = GaussianTemplates().floor_sigma ** 2 * variance * np.ones((BINS, BINS))
    samples = cell.averaged[0].astype(np.float64)
    logs = np.empty((len(FRAMES), *cell.valid.shape, *cell.valid.shape))
    for f, (ship, aspect) in ((f, view) for f in range(2) for view in np.ndindex(cell.valid.shape)):
        mean = cell.expected[ship, aspect].astype(np.float64)
        signal = gain * (mean - mean[0])
        frame = (
            dense(covariance[ship, aspect]) + diagonal_loading * variance * np.eye(BINS)
        ) / FRAMES[f]
        density = multivariate_normal(mean, frame + np.outer(signal, signal) + shift)
        logs[f, ..., ship, aspect] = density.logpdf(samples[f])
    # The axes are the test's aspect, the ship and the template's aspect.
    same_aspect = np.eye(len(ASPECTS), dtype=bool)[:, None, :]
    for j, left_out in enumerate(BOTH):
        answering = np.broadcast_to(~(same_aspect & left_out), logs.shape)
        of_ship = logsumexp(logs, axis=-1, b=answering) - np.log(answering.sum(axis=-1))
        posterior = np.exp(of_ship - logsumexp(of_ship, axis=-1, keepdims=True))
        true = np.take_along_axis(posterior, np.arange(SHIPS)[None, :, None, None], axis=-1)[..., 0]
        probability = answers["probability"][j, place]
        # Logarithms of some 100 err by 1e-13 of it times the condition of the covariances, 1e4.
        np.testing.assert_allclose(probability, true, atol=1e-6)
        np.testing.assert_array_equal(answers["predicted"][j, place], posterior.argmax(axis=-1))
        # Many of them are in doubt.
        assert np.mean((probability > 0.05) & (probability < 0.95)) > 0.1
    right = answers["predicted"] == np.arange(SHIPS)[:, None]
    np.testing.assert_array_equal(answers["correct"], right)


@pytest.mark.parametrize("error", ERRORS)
def test_left_out_aspects_are_never_learned(error):
    """Reversing all profiles at an aspect changes no answer that leaves it out, but others.

    The cells of templates beside it do not change, either.
    """
    cell = made(noise=0.6)
    before = answered(cell, left_out=BOTH, error=error)
    for column in range(len(ASPECTS)):
        expected = cell.expected.copy()
        expected[:, column] = expected[:, column, ::-1]
        changed = cell.changed(expected=expected)
        after = answered(changed, left_out=BOTH, covariance=bands(cell), error=error)
        for name in before.keys() - {"calibrated_error"}:
            first, second = (answers[name][:, 0, ..., column] for answers in (before, after))
            np.testing.assert_array_equal(first[1], second[1], err_msg=name)
            if name == "probability":
                assert (first[0] != second[0]).any()


def test_estimated_floor_makes_densities_invariant_to_offsets():
    """Constants added to profiles and templates change densities of a known floor alone."""
    rng = np.random.default_rng(5)
    cell = made(noise=5.0)
    lifted = rng.uniform(-40, 40, (*cell.averaged.shape[:-1], 1)).astype(np.float32)
    lifted_templates = rng.uniform(-40, 40, (*cell.expected.shape[:-1], 1)).astype(np.float32)
    covariance = bands(cell, variance=25.0)
    densities = {}
    for name, up, down in (("as it is", 0, 0), ("lifted", lifted, lifted_templates)):
        shifted = cell.changed(expected=cell.expected + down, averaged=cell.averaged + up)
        for estimated in BOTH:
            prior = likelihood.Prior(1e-3, 0.0, estimated)
            views = shifted.valid[None], learned(), ~learned()
            inputs = shifted.expected[None], covariance, *views, ASPECTS, prior
            moments = likelihood.profile_moments(*inputs)
            templates = likelihood.profile_templates(moments, np.array(0.0))
            densities[name, estimated] = scores(templates, shifted.averaged[0], 0.0, prior)
    scale = np.max(np.abs(densities["as it is", True]))
    np.testing.assert_allclose(
        densities["lifted", True], densities["as it is", True], atol=1e-4 * scale
    )
    assert np.max(np.abs(densities["lifted", False] - densities["as it is", False])) > scale / 10


@pytest.mark.parametrize("error", ERRORS)
def test_blockwise_answers_equal_those_of_all_views_at_once(error, monkeypatch):
    """Some views are missing, and a ship and two aspects are not learned."""
    cell = made(noise=5.0).without([0, 2, 2], [3, 0, 5])
    known = {"unknown": ("c",), "training_aspect": (0.0, 30.0, 59.9, 60.0)}
    expected = answered(cell, GAINS, BOTH, error=error, **known)
    monkeypatch.setattr(likelihood, "row_blocks", lambda count, most: row_blocks(count, 4))
    rows = rows_of_densities(monkeypatch)
    for name, values in answered(cell, GAINS, BOTH, error=error, **known).items():
        # Probabilities are sums of as many terms as templates.
        np.testing.assert_allclose(values, expected[name], rtol=1e-13, err_msg=name)
    assert set(np.unique(expected["predicted"])) == {-1, 0, 1}
    assert max(rows) == 4


def test_exact_track_uses_only_templates_at_its_aspect():
    """With an error of 1000 deg, probabilities differ from those without a track."""
    cell = made(noise=5.0)
    covariance = bands(cell, variance=25.0)
    exact, vague, none = (
        answered(cell, covariance=covariance, aspect_sigma=sigma) for sigma in (0.0, 1000.0, None)
    )
    densities = scores(
        templates_of(cell, covariance), cell.averaged[0], 1.0, likelihood.Prior(1e-3, 1.0, False)
    ).reshape(len(FRAMES), *cell.valid.shape, *cell.valid.shape)
    beside = np.einsum("fsata->fsat", densities)  # of every ship, at the true aspect
    posterior = np.exp(beside - logsumexp(beside, axis=-1, keepdims=True))
    true = np.einsum("fsas->fsa", posterior)
    np.testing.assert_allclose(exact["probability"][0, 0], true, rtol=1e-9)
    # A flat prior gives uneven cells uneven shares.
    assert np.abs(vague["probability"] - none["probability"]).max() > 1e-3
    assert (exact["probability"] > none["probability"]).mean() > 0.5


def test_track_errors_are_keyed_by_view_and_scale_with_sigma():
    """Other ships and aspects change no error; each draw, seed and view has its own."""
    errors = likelihood.track(NAMED, ASPECTS, 2.0, 0, 0).reported - np.array(ASPECTS)
    few = likelihood.track(NAMED[1:], ASPECTS[::2], 6.0, 0, 0).reported - np.array(ASPECTS[::2])
    np.testing.assert_allclose(few, 3 * errors[1:, ::2], atol=1e-12)
    drawn = np.array(
        [
            likelihood.track(NAMED, tuple(range(60)), 1.0, replicate, seed).reported - range(60)
            for replicate, seed in ((0, 0), (1, 0), (0, 1))
        ]
    )
    assert len(np.unique(drawn.round(9))) == drawn.size
    # 540 normal deviates: mean and variance within four of their standard errors.
    assert abs(drawn.mean()) < 4 / np.sqrt(drawn.size)
    assert abs(drawn.var() - 1) < 4 * np.sqrt(2 / drawn.size)


@pytest.mark.parametrize("weight", [0.0, 0.5])
def test_acceptance_uses_the_likelihood_ratio_to_the_alternative(weight):
    """Three points on a line have a closed form; by Neyman and Pearson no test keeps more.

    The third ship is the alternative: one class more, which is never named. Similarity falls with
    a power of the chi-squared probability of the best template's distance.
    """
    tests, bins, positions = 2000, 16, np.array([0.0, 1.0, 2.5])
    known = np.zeros((SHIPS, tests), dtype=bool)
    known[:2, 0] = True
    means = np.zeros((SHIPS, bins))
    means[:, 8] = positions
    exact = {"gain_sigma": 0.0, "floor_sigma": 0.0, "template_error": 0.0, "diagonal_loading": 0.0}
    fitted = [
        GaussianTemplates(**exact).fit(
            means[some], np.ones((len(some), 1, bins)), some, np.zeros((len(some), 1))
        )
        for some in ([0, 1], [2])
    ]
    profiles = np.zeros((SHIPS, tests, bins))
    profiles[..., 8] = positions[:, None] + norm.ppf((np.arange(tests) + 0.5) / tests)
    answers = likelihood.likelihood(
        *((fitted[0], known), (fitted[1], np.roll(known, 1, axis=0) & ~known)),
        *(profiles[None], known | True, likelihood.Prior(0.0, 0.0, False)),
        likelihood.Track(tuple(range(tests)), None, np.zeros(known.shape)),
        **{
            "misfit_weight": weight,
            "gain_sigma": (0.0,),
            "frame_count": (1,),
            "left_out": (False,),
        },
        ship=NAMED[:SHIPS],
    )
    answers = {name: values[0, 0, 0] for name, values in answers.items()}
    logs = norm.logpdf(profiles[..., 8, None], positions)
    likely = logs[..., :2].max(axis=-1)
    np.testing.assert_array_equal(answers["predicted"], logs[..., :2].argmax(axis=-1))
    probability = np.exp(logs - logsumexp(logs, axis=-1, keepdims=True))
    for ship in (0, 1):
        true = probability[ship, :, ship]
        np.testing.assert_allclose(answers["probability"][ship], true, rtol=1e-9)
    distance = np.square(profiles[..., 8, None] - positions[:2]).min(axis=-1)
    np.testing.assert_allclose(answers["fit"], chi2.logsf(distance, bins), rtol=1e-9, atol=1e-12)
    similarity = expit(likely - logs[..., 2]) * np.exp(weight * answers["fit"])
    np.testing.assert_allclose(answers["similarity"], similarity, rtol=1e-9)
