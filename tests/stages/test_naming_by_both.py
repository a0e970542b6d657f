"""Profile and silhouette together: by hand on made-up views, and on ships at sea."""

import numpy as np
import pytest
import xarray as xr
from infrared_channel import EXPERIMENT, choose
from range_channel import (
    ASPECTS,
    BINS,
    FRAMES,
    NAMED,
    REPLICATES,
    SHIPS,
    bands,
    dense,
    learned,
    made,
)
from scipy import stats
from scipy.optimize import minimize
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from ncti.classify import GaussianTemplates
from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.plan import Plan
from sweeps.engine.run import Place, sweep
from sweeps.engine.schedule import Watch
from sweeps.stages import fusion
from sweeps.stages.fusion import CHANNELS, calibrate, check, similarity
from sweeps.stages.likelihood import profile_moments, profile_scores

GRID = (SHIPS, len(ASPECTS))
VIEWS = SHIPS * len(ASPECTS)
PHASES, LOOKS = 4, (4, 16)
PROFILE_DOUBT = 0.1
GAINS, NUGGET, VARIANCE = (0.0, 0.7), 0.02, 25.0
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


def compared(cell, templates, seen, there=None, **training_views):
    """Scores of profiles (replicate, gain, count, view, template); of silhouettes; constants."""
    there = np.ones((PHASES, *GRID), dtype=bool) if there is None else there
    known = cell.expected, bands(cell, VARIANCE), cell.there, learned(**training_views), ASPECTS
    moments = profile_moments(*known, NUGGET, 1.0, np.array(0.0))  # exact, as by hand
    profiles = np.stack(
        [profile_scores(moments, averaged, cell.there, GAINS, FRAMES) for averaged in cell.averaged]
    )
    silhouettes = fusion.silhouette_scores(templates, seen, there)
    constants = [fusion.silhouette_constants(one, learned(**training_views)) for one in silhouettes]
    return profiles, silhouettes, constants


def named_by(profiles, silhouettes, constants, g, m, n, doubt=0.0, **training_views):
    scores = profiles[:, g, n], silhouettes[m], constants[m], np.full(VIEWS, doubt)
    return fusion.fusion(*scores, learned(**training_views), NAMED, ASPECTS)


def density_by_hand(cell, gain_sigma):
    """(replicate, count, view, template) logarithms of a Gaussian's density."""
    covariance = bands(cell, VARIANCE).reshape(VIEWS, -1, BINS)
    expected = cell.expected.reshape(VIEWS, BINS).astype(np.float64)
    samples = cell.averaged.reshape(REPLICATES, len(FRAMES), VIEWS, BINS).astype(np.float64)
    variance = covariance[:, 0].mean(dtype=np.float64)
    shift = GaussianTemplates().floor_sigma ** 2 * variance * np.ones((BINS, BINS))
    logs = np.empty((*samples.shape[:3], VIEWS))
    for n, view in np.ndindex(len(FRAMES), VIEWS):
        mean = expected[view]
        signal = gain_sigma * (mean - mean[0])  # its own edge is its floor
        frame = (dense(covariance[view]) + NUGGET * variance * np.eye(BINS)) / FRAMES[n]
        gaussian = multivariate_normal(mean, frame + np.outer(signal, signal) + shift)
        logs[:, n, :, view] = gaussian.logpdf(samples[:, n])
    return logs


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


def surprise_by_hand(scores, training_views, phase, sharpness, doubt):
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
    posterior = posterior_by_hand(sharpness * rows, training_views)
    sure = (1 - doubt) * np.take_along_axis(posterior, true, -1) + doubt / ships
    said = np.log(sure).sum(axis=(1, 2, 3)) @ [11 / 12, 1 / 12]
    return -(said + np.log(1 - doubt + doubt / ships) + np.log(doubt / ships))


def is_likeliest(scores, training_views, phase, constants):
    """Whether no other sharpness and doubt make more of the ships."""

    def surprise(both):
        of_phase = scores, training_views, phase, np.exp(both[0]), 1 / (1 + np.exp(-both[1]))
        return surprise_by_hand(*of_phase)

    found = surprise_by_hand(scores, training_views, phase, *constants)
    starts = [(np.log(sharpness), start) for sharpness in (3, 30, 300) for start in (-2, 1)]
    other = min(minimize(surprise, x, method="Nelder-Mead").fun for x in starts)
    return found <= other + 1e-4  # where the searches stop


def doubted_by_hand(scores, training_views, doubt):
    """(..., template) logarithms of densities relative to their mean over ships, with a doubt."""
    ships = np.unique(SHIP[training_views])
    own = [scores[..., training_views & (s == SHIP)] for s in ships]
    means = np.stack([logsumexp(one, axis=-1) - np.log(one.shape[-1]) for one in own])
    mean = logsumexp(means, axis=0) - np.log(len(ships))
    return np.log((1 - doubt) * np.exp(scores - mean[..., None]) + doubt)


@pytest.mark.parametrize("unknown", [None, ("b",)])
def test_by_hand(unknown):
    """Every gain, number of frames and draw; a ship that is learned, or is not."""
    training_views = np.ones(VIEWS, dtype=bool) if unknown is None else SHIP != 1
    cell, (templates, seen) = made(noise=5.0), maps()
    scores = compared(cell, templates, seen, unknown=unknown)
    cosines = similarity_by_hand(templates, seen)
    logs = [density_by_hand(cell, gain) for gain in GAINS]
    for m, phase in np.ndindex(len(LOOKS), PHASES):
        assert is_likeliest(cosines[m], training_views, phase, scores[2][m][:, phase])
    doubtful = []
    for g, m, n in np.ndindex(len(GAINS), len(LOOKS), len(FRAMES)):
        found = named_by(*scores, g, m, n, PROFILE_DOUBT, unknown=unknown)
        assert found["predicted"].shape == (3, PHASES, *GRID)
        np.testing.assert_array_equal(found["sharpness"][0], 1)
        np.testing.assert_array_equal(found["sharpness"][1:], scores[2][m][[0, 0]])
        calm = np.full(PHASES, PROFILE_DOUBT)
        np.testing.assert_allclose(found["doubt"], [calm, scores[2][m][1], calm], rtol=1e-15)
        for d in range(PHASES):
            profile = logs[g][d % REPLICATES, n]
            sharpness, doubt = scores[2][m][:, d]
            silhouette = doubted_by_hand(sharpness * cosines[m, d], training_views, doubt)
            both = doubted_by_hand(profile, training_views, PROFILE_DOUBT) + silhouette
            for c, alone in enumerate((profile, silhouette, both)):
                wanted = posterior_by_hand(alone, training_views)
                true = wanted[np.arange(VIEWS), SHIP]
                # Of a sharpness that is off by 2e-4, times scores that differ by some 20.
                np.testing.assert_allclose(found["probability"][c, d].ravel(), true, atol=4e-3)
                named = found["predicted"][c, d].ravel()
                clear = np.diff(np.sort(wanted), axis=1)[:, -1] > 1e-2
                np.testing.assert_array_equal(named[clear], wanted.argmax(axis=1)[clear])
                np.testing.assert_array_equal(found["correct"][c, d].ravel(), named == SHIP)
                doubtful.append((wanted.max(axis=1) > 0.05) & (wanted.max(axis=1) < 0.95))
        np.testing.assert_array_equal(found["cell"], 1)
    assert np.mean(doubtful) > 0.2


def test_an_empty_silhouette_names_the_first_ship_of_those_learned():
    """All are equally likely, so that the order of names decides."""
    for unknown, first in ((None, 0), (("a",), 1)):
        scores = compared(made(), *maps(), unknown=unknown)
        assert not scores[1][1, 1, 2].any()
        found = named_by(*scores, 0, 1, 0, unknown=unknown)
        assert found["predicted"][1, 1, 0, 2] == first
        expected = 1 / SHIPS if unknown is None else 0
        assert found["probability"][1, 1, 0, 2] == pytest.approx(expected)


def test_a_view_that_one_sensor_lost_is_left_out():
    """Of some the profiles, of another one the silhouette of one phase."""
    cell, (templates, seen) = made(noise=5.0), maps()
    there = np.ones((PHASES, *GRID), dtype=bool)
    there[1, 0, 3] = False
    scores = compared(cell.without(2, [0, 1]), templates, seen, there)
    found = named_by(*scores, 1, 0, 0)
    left = np.ones(GRID, dtype=bool)
    left[2, :2] = left[0, 3] = False
    for name, gone in (("predicted", -1), ("correct", -1), ("cell", 0)):
        assert (found[name][..., ~left] == gone).all() and (found[name][..., left] >= 0).all()
    assert (np.isnan(found["probability"]) == ~left).all()
    # What is left is compared with what is left alone.
    profiles, silhouettes, constants = scores
    views = left.ravel()
    sharpness, doubt = constants[0][:, 0]
    silhouette = np.where(views, sharpness * silhouettes[0, 0], -np.inf)
    doubted = doubted_by_hand(silhouette, views, doubt)
    for c, one in enumerate((profiles[0, 1, 0], doubted)):
        true = posterior_by_hand(one[views].astype(float), views)[
            np.arange(views.sum()), SHIP[views]
        ]
        np.testing.assert_allclose(found["probability"][c, 0][left], true, atol=1e-6)


def test_a_score_does_not_depend_on_its_company():
    """Gains and numbers of frames, to the last bit."""
    cell, (templates, seen) = made(noise=5.0), maps()
    known = cell.expected, bands(cell, VARIANCE), cell.there, learned(), ASPECTS
    moments = profile_moments(*known, NUGGET, 1.0, np.array(0.0))  # exact, as by hand
    there = np.ones((PHASES, *GRID), dtype=bool)
    profiles = profile_scores(moments, cell.averaged[0], cell.there, GAINS, FRAMES)
    silhouettes = fusion.silhouette_scores(templates, seen, there)
    for k in range(2):
        for g in range(2):
            alone = profile_scores(
                moments, cell.averaged[0, [k]], cell.there, (GAINS[g],), (FRAMES[k],)
            )
            np.testing.assert_array_equal(alone[0, 0], profiles[g, k])
        alone = fusion.silhouette_scores(templates, seen[[k]], there)
        np.testing.assert_array_equal(alone[0], silhouettes[k])


def test_similarity_is_the_best_cosine_over_other_phases():
    templates, seen = maps()
    known = (templates / 255).astype(np.float32).reshape(PHASES, VIEWS, -1)
    shown = (seen[0] / 255).astype(np.float32).reshape(PHASES, VIEWS, -1)
    found = similarity(shown, known)
    # float32 products of a dozen numbers
    np.testing.assert_allclose(found, similarity_by_hand(templates, seen)[0], atol=1e-6)
    # A silhouette's own phase has no say, any other has.
    for phase in range(PHASES):
        other = known.copy()
        other[phase] = other[phase, :, ::-1]
        changed = np.any(similarity(shown, other) != found, axis=(1, 2))
        np.testing.assert_array_equal(changed, np.arange(PHASES) != phase)


def test_a_phase_is_not_calibrated_on_itself():
    """A phase whose scores are all wrong does not raise its own doubt, but that of the others."""
    ship, aspect = np.divmod(np.arange(20), 10)
    good = np.where(ship[:, None] == ship, 1.0, 0.0)
    _, doubt = calibrate(np.stack([-good, good, good]), ship, aspect)
    assert doubt[0] < 0.05
    assert doubt[1] == pytest.approx(doubt[2]) and doubt[1] > 0.9


# Where there is fusion

BOTH = {"sensor": "both", "grid__ship": ["duncan", "texas"], "grid__aspect": [0, 90]}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"sensor": "range"}, "sensor is 'range', but must be both for the classifier fusion"),
        (
            {"grid__range": [50, 75], "infrared__range": [25, 50]},
            "grid.range has 75, but every value must be one of 25, 50, the values of "
            "infrared.range, for the classifier fusion",
        ),
        (
            {"infrared__phases": 1},
            "infrared.phases is 1, but must be at least 2 for the classifier fusion, which weighs "
            "the silhouettes of one by those of others",
        ),
        (
            {"ladar__receiver": "first_pulse"},
            "ladar.receiver is 'first_pulse', but must be full_profile for the classifier fusion, "
            "which knows the moments of no other",
        ),
    ],
)
def test_refusals(given, said):
    with pytest.raises(ConfigurationError, match=f"^{said}$"):
        check(choose(**BOTH | {"classifier__name": "fusion"} | given))


def test_a_cell_goes_with_the_silhouettes_of_its_range():
    """Of both sensors' ranges those that are equal, wherever they are on their axes."""
    several = BOTH | {"classifier__name": "fusion", "infrared__range": [25, 50, 100]}
    plan = Plan(EXPERIMENT, choose(**several, grid__range=[50, 100], grid__frame_count=16))
    bound, source = plan.bound["fusion"], plan.bound["silhouette_scores"]
    for place in plan.cells(bound):
        slant_range = plan.value(bound, "grid.range", place)
        there = plan.source_place(bound, source, place)
        assert plan.value(source, "infrared.range", there) == slant_range


# Ships at sea


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Both sensors, with silhouettes at more ranges and of more phases than there are profiles."""
    folder = tmp_path_factory.mktemp("fusion")
    choices = choose(
        sensor="both",
        classifier__name=["acn", "fusion"],
        classifier__gain_sigma=[0, 1],
        grid__aspect={"start": 0, "stop": 90, "step": 6},
        grid__range=[50, 100],
        grid__frame_count=[4, 16],
        grid__replicate=2,
        grid__vigilance=0.87,
        infrared__range=[25, 50, 100],
        infrared__frame_count=16,
        infrared__super_resolution=["none", "perfect"],
        infrared__phases=3,
        infrared__orders=3,
        render__pixel=0.5,
    )
    place = Place(folder / "s.zarr", folder / "cache", ClusterChoice(kind="inline"))
    done = sweep(EXPERIMENT, choices, place, Watch(say=lambda sentence: None))
    assert not done.failures
    return place.store


@pytest.fixture(scope="module")
def answers(store):
    return xr.open_zarr(store, group="classification/fusion").load()


def accuracy(tables, slant_range, way, part="accuracy"):
    return tables[part].sel(range=slant_range, super_resolution=way).squeeze()


def test_both_are_at_least_as_good_as_the_better_one(store):
    """In every bin, at every range, number of frames and resolution, within the interval."""
    tables = xr.open_zarr(store, group="tables/fusion").load()
    assert tables.accuracy.size == 3 * 2 * 2 * 2 * 2 * 4
    better = tables.accuracy.sel(channel=["range", "infrared"]).max("channel")
    assert (tables.ci_high.sel(channel="both") >= better).all()


def gain_over(correct, other):
    """(mean, standard error) of the share right by both sensors less that of other answers.

    Differences are paired and averaged over all that a view has in common, draws, ranges,
    numbers of frames and resolutions; the error is from their scatter over views.
    """
    paired = correct.sel(channel="both") - other
    of_view = paired.mean([name for name in paired.dims if name not in ("ship", "aspect")])
    return float(of_view.mean()), float(of_view.std(ddof=1)) / np.sqrt(of_view.size)


def test_both_lose_nothing_to_the_better_one_on_the_whole(answers):
    """One-sided t at a level of 1e-3 over 64 views, each answered in 16 cells by 3 draws.

    The better sensor of a cell is the one with more right answers in it: where they are alike,
    choosing it by the same answers counts against both. The standard error is 0.6 points, the
    bound so some 2 points of loss; to heed the worse sensor alone costs many times that.
    """
    correct = answers.correct.astype(float)
    alone = correct.sel(channel=["range", "infrared"])
    share = alone.mean(["draw", "ship", "aspect"])
    better, worse = (
        alone.isel(channel=choice) for choice in (share.argmax("channel"), share.argmin("channel"))
    )
    bound = stats.t.isf(1e-3, 64 - 1)
    assert correct.ship.size * correct.aspect.size == 64
    gain, error = gain_over(correct, better)
    assert gain >= -bound * error
    # The same statistic tells the worse sensor from the better one.
    heeding_it = correct.copy()
    heeding_it.loc[{"channel": "both"}] = worse.drop_vars("channel")
    loss, error = gain_over(heeding_it, better)
    assert loss < -bound * error


def test_at_50_km_and_16_frames_nearly_every_ship_is_named(store):
    tables = xr.open_zarr(store, group="tables/fusion").load()
    both = tables.accuracy.sel(channel="both", range=50, frame_count=16, aspect_bin="overall")
    assert (both > 0.95).all()


def test_draws_pair_replicates_with_phases(answers):
    assert answers.draw.values.tolist() == [0, 1, 2]
    alone = answers.predicted.sel(channel="range")
    # Profiles of draw 2 are those of draw 0 over again, whatever silhouettes go with them.
    np.testing.assert_array_equal(alone.sel(draw=0), alone.sel(draw=2))
    assert (alone == alone.isel(super_resolution=0)).all()
    seen = answers.predicted.sel(channel="infrared")
    assert (seen == seen.isel(frame_count=0)).all()
    assert (seen == seen.isel(gain_sigma=0)).all()  # silhouettes have no gain
    assert (alone.sel(gain_sigma=0) != alone.sel(gain_sigma=1)).any()


def test_the_store_tells_what_the_axes_are(store, answers):
    assert tuple(answers.channel.values) == CHANNELS
    assert answers.infrared_frame_count.values.tolist() == [16]
    assert answers.frame_count.values.tolist() == [4, 16]
    assert answers.range.values.tolist() == [50, 100]
    assert answers.segmentation == "matched" and answers.coverage_rule == 0.25
    state = xr.open_zarr(store, group="status_fusion").load()
    assert state.cell.dims == answers.correct.dims and (state.cell == 1).all()
    assert tuple(state.channel.values) == CHANNELS


# The source's Table 5


@pytest.fixture(scope="module")
def tables(store):
    return xr.open_zarr(store, group="tables/acn_infrared").load()


@pytest.mark.parametrize(("slant_range", "way"), [(25, "none"), (50, "perfect"), (50, "none")])
def test_ends_of_ships_are_told_apart_worst(tables, slant_range, way):
    near_bow, *others, _ = accuracy(tables, slant_range, way).values.tolist()
    assert near_bow + 0.1 < min(others)


def test_perfect_super_resolution_makes_50_km_as_good_as_25(tables):
    """In every bin within the intervals of a bin's 20 to 24 answers."""
    near, far = (accuracy(tables, *look).values for look in ((25, "none"), (50, "perfect")))
    low, high = (accuracy(tables, 25, "none", part).values for part in ("ci_low", "ci_high"))
    assert ((low <= far) & (far <= high)).all()
    assert abs(near - far).max() < 0.15


def test_the_detector_s_own_pixels_do_worse_the_farther_they_are(tables):
    overall = [
        accuracy(tables, *look).values[-1] for look in ((25, "none"), (50, "none"), (100, "none"))
    ]
    assert overall[0] > overall[1] > overall[2] > 0.25  # which is chance
