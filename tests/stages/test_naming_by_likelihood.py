"""Maximum likelihood on profiles made up, against densities by hand."""

import numpy as np
import pytest
from range_channel import ASPECTS, BINS, FRAMES, SHIPS, bands, choose, dense, learned, made
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from ncti.classify import GaussianTemplates
from sweeps.engine.errors import ConfigurationError
from sweeps.stages import likelihood

BOTH = (False, True)
GAINS = (0.0, 0.7)
ERRORS = (0.0, 0.2)


def moments_of(cell, covariance, nugget=1e-3, error=0.0, floor_sigma=1.0, **training_views):
    """Templates of what is learned; exact ones by default, as densities by hand are."""
    known = learned(**training_views)[: len(cell.there)]
    given = cell.expected, covariance, cell.there, known, ASPECTS, nugget, floor_sigma
    rng = np.random.default_rng(0)
    found = likelihood.calibrated_error(*given, error, False, rng)
    return likelihood.profile_moments(*given, found)


def answered(
    cell, gains=(1.0,), left_out=(False,), frames=FRAMES, replicate=0, nugget=1e-3, **given
):
    aspect_known = given.pop("aspect_known", False)
    covariance = given.pop("covariance", None)
    covariance = bands(cell) if covariance is None else covariance
    moments = moments_of(cell, covariance, nugget, **given)
    averaged = cell.averaged[replicate, [FRAMES.index(count) for count in frames]]
    scores = likelihood.profile_scores(moments, averaged, cell.there, gains, frames)
    given = scores, averaged, cell.there, gains, left_out, frames, aspect_known
    return likelihood.likelihood(moments, *given)


@pytest.mark.parametrize(("place", "gain"), list(enumerate(GAINS)))
def test_by_hand(place, gain):
    """Densities of a Gaussian with gain and floor as two more directions of its covariance.

    Each view has a floor of its own, which no gain changes.
    """
    cell = made(noise=5.0)
    floors = np.linspace(0, 5, cell.there.size, dtype=np.float32).reshape(*cell.there.shape, 1)
    cell = cell.changed(expected=cell.expected + floors, averaged=cell.averaged + floors)
    nugget, covariance = 0.02, bands(cell, variance=25.0)
    answers = answered(cell, GAINS, BOTH, nugget=nugget, covariance=covariance)
    variance = covariance[..., 0, :].mean(dtype=np.float64)
    shift = GaussianTemplates().floor_sigma ** 2 * variance * np.ones((BINS, BINS))
    samples = cell.averaged[0].astype(np.float64)
    logs = np.empty((len(FRAMES), *cell.there.shape, *cell.there.shape))
    for f, (ship, aspect) in ((f, at) for f in range(2) for at in np.ndindex(cell.there.shape)):
        mean = cell.expected[ship, aspect].astype(np.float64)
        signal = gain * (mean - mean[0])
        frame = (dense(covariance[ship, aspect]) + nugget * variance * np.eye(BINS)) / FRAMES[f]
        density = multivariate_normal(mean, frame + np.outer(signal, signal) + shift)
        logs[f, ..., ship, aspect] = density.logpdf(samples[f])
    same = np.eye(len(ASPECTS), dtype=bool)[:, None, :]  # test's aspect, ship, template's aspect
    for j, left_out in enumerate(BOTH):
        answering = np.broadcast_to(~(same & left_out), logs.shape)
        of_ship = logsumexp(logs, axis=-1, b=answering) - np.log(answering.sum(axis=-1))
        posterior = np.exp(of_ship - logsumexp(of_ship, axis=-1, keepdims=True))
        true = np.take_along_axis(posterior, np.arange(SHIPS)[None, :, None, None], axis=-1)[..., 0]
        found = answers["probability"][place, j]
        # Logarithms of some 100 err by 1e-13 of it times the condition of the covariances, 1e4.
        np.testing.assert_allclose(found, true, atol=1e-6)
        np.testing.assert_array_equal(answers["predicted"][place, j], posterior.argmax(axis=-1))
        assert np.mean((found > 0.05) & (found < 0.95)) > 0.1  # many of them are in doubt
    right = answers["predicted"] == np.arange(SHIPS)[:, None]
    np.testing.assert_array_equal(answers["correct"], right)


@pytest.mark.parametrize("error", ERRORS)
def test_an_answer_does_not_depend_on_its_company(error):
    """On any axis, to the last bit."""
    cell = made(noise=3.0)
    whole = answered(cell, GAINS, BOTH, error=error)
    for g, k, f in np.ndindex(2, 2, 2):
        alone = answered(cell, (GAINS[g],), (BOTH[k],), (FRAMES[f],), error=error)
        for name, values in alone.items():
            np.testing.assert_array_equal(values[0, 0, 0], whole[name][g, k, f], err_msg=name)


@pytest.mark.parametrize("error", ERRORS)
def test_nothing_is_learned_of_an_aspect_that_is_left_out(error):
    """Profiles of all ships at it may be anything; without leaving out, they matter.

    Nor do they matter to the cells of templates beside it.
    """
    cell = made(noise=0.6)
    before = answered(cell, left_out=BOTH, error=error)
    for column in range(len(ASPECTS)):
        expected = cell.expected.copy()
        expected[:, column] = expected[:, column, ::-1]
        changed = cell.changed(expected=expected)
        after = answered(changed, left_out=BOTH, covariance=bands(cell), error=error)
        for name in before.keys() - {"calibrated_error"}:
            first, second = (one[name][0, ..., column] for one in (before, after))
            np.testing.assert_array_equal(first[1], second[1], err_msg=name)
            if name == "probability":
                assert (first[0] != second[0]).any()


def test_views_that_are_not_learned_are_named_alone():
    cell = made()
    untrained = np.zeros_like(cell.there)
    untrained[2] = untrained[:, 1] = True
    training_views = {"unknown": ("c",), "training_aspect": (0.0, 30.0, 59.9, 60.0, 90.0)}
    before = answered(cell, left_out=BOTH, **training_views)
    expected = cell.expected.copy()
    expected[untrained] = expected[untrained][:, ::-1]
    after = answered(cell.changed(expected=expected), left_out=BOTH, **training_views)
    for name, values in before.items():
        np.testing.assert_array_equal(after[name], values, err_msg=name)
    assert set(np.unique(before["predicted"])) == {0, 1}
    assert (before["probability"][..., 2, :] == 0).all()
    assert before["correct"][:, 0][..., ~untrained].all()


def test_views_that_are_not_there_change_no_other_answer():
    cell = made(noise=1.0)
    lost = cell.without(2, slice(None))
    # Templates share the mean variance of those that are there.
    answers = answered(lost, covariance=bands(cell))
    smaller = cell.changed(
        expected=cell.expected[:2], averaged=cell.averaged[:, :, :2], there=cell.there[:2]
    )
    for name, values in answered(smaller, covariance=bands(cell)[:2]).items():
        np.testing.assert_array_equal(answers[name][..., :2, :], values, err_msg=name)
    assert (answers["predicted"][..., 2, :] == -1).all()
    assert np.isnan(answers["probability"][..., 2, :]).all()
    assert (answers["cell"][..., 2, :] == 0).all()


def test_a_test_that_is_lost_is_a_template_all_the_same():
    """A view may be there in training, and its test not."""
    cell = made(noise=1.0)
    whole = answered(cell)
    moments = moments_of(cell, bands(cell))
    lost = cell.without(1, 3)
    given = lost.averaged[0], lost.there, (1.0,)
    scores = likelihood.profile_scores(moments, *given, FRAMES)
    found = likelihood.likelihood(moments, scores, *given, (False,), FRAMES, False)
    kept = lost.there
    np.testing.assert_allclose(
        found["probability"][..., kept], whole["probability"][..., kept], atol=1e-12
    )
    assert (found["cell"][..., ~kept] == 0).all()


@pytest.mark.parametrize("receiver", ["first_pulse", ["full_profile", "peak_pulse"]])
def test_moments_of_one_receiver_are_known(receiver):
    given = {"ladar__receiver": receiver, "classifier__name": ["acn", "likelihood"]}
    with pytest.raises(
        ConfigurationError, match=r"^ladar\.receiver is '.*_pulse', but must be full_profile"
    ):
        likelihood.check(choose(**given))
    likelihood.check(choose(**given | {"classifier__name": "acn"}))


def test_an_answer_is_as_sure_as_its_ship_is_probable():
    cell = made(noise=3.0)
    sure = answered(cell)["similarity"]
    templates, _ = moments_of(cell, bands(cell))
    for f, count in enumerate(FRAMES):
        posterior = templates.posterior(cell.averaged[0, f][cell.there], count).max(axis=1)
        np.testing.assert_allclose(sure[0, 0, f].ravel(), posterior, rtol=1e-9)


def test_a_known_aspect_leaves_its_own_templates():
    """Those at other aspects may be anything."""
    cell = made(noise=3.0)
    before = answered(cell, aspect_known=True)
    expected = cell.expected.copy()
    expected[:, 1:] = expected[:, 1:, ::-1]
    changed = answered(cell.changed(expected=expected), covariance=bands(cell), aspect_known=True)
    for name, values in before.items():
        np.testing.assert_array_equal(
            values[..., 0] if values.ndim > 3 else values,
            changed[name][..., 0] if values.ndim > 3 else changed[name],
        )
    free = answered(cell)
    assert before["correct"].mean() >= free["correct"].mean()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"classifier__left_out": True}, r"classifier\.left_out has True"),
        ({"classifier__training_aspect": [0, 30]}, "an aspect of the grid is not learned"),
    ],
)
def test_a_known_aspect_must_be_learned(given, said):
    known = {"classifier__name": "likelihood", "classifier__aspect_known": True}
    message = f"^classifier.aspect_known has True, but must be false where {said}$"
    with pytest.raises(ConfigurationError, match=message):
        likelihood.check(choose(**known | given))
    likelihood.check(choose(**known))


def test_an_estimated_floor_is_whatever_the_edges_hold():
    """Any constant added to a profile or a template changes nothing; of a known floor it does."""
    rng = np.random.default_rng(5)
    cell = made(noise=5.0)
    lifted = rng.uniform(-40, 40, (*cell.averaged.shape[:-1], 1)).astype(np.float32)
    other = rng.uniform(-40, 40, (*cell.expected.shape[:-1], 1)).astype(np.float32)
    covariance = bands(cell, variance=25.0)
    found = {}
    for name, up, down in (("as it is", 0, 0), ("lifted", lifted, other)):
        here = cell.changed(expected=cell.expected + down, averaged=cell.averaged + up)
        for estimated in BOTH:
            given = here.expected, covariance, here.there, learned(), ASPECTS, 1e-3, 0.0
            moments = likelihood.profile_moments(*given, np.array(0.0), estimated)
            seen = here.averaged[0], here.there, (0.0,), FRAMES, estimated
            found[name, estimated] = likelihood.profile_scores(moments, *seen)
    scale = np.nanmax(np.abs(found["as it is", True]))
    np.testing.assert_allclose(found["lifted", True], found["as it is", True], atol=1e-4 * scale)
    assert np.nanmax(np.abs(found["lifted", False] - found["as it is", False])) > scale / 10
