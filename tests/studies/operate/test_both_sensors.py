"""Both sensors together lose nothing to the better one, at random aspects not learned."""

from functools import cache

import numpy as np
import pytest
from scipy.special import logsumexp

import ncti.ships
from ncti.infrared import Imager
from studies.operate.identify import Trial, identify, match_silhouettes, packed, planned_views
from studies.operate.matching import (
    fit_inverse_temperature,
    joint_evidence,
    over_places,
    relative_densities,
    ship_evidence,
)
from studies.operate.profiles import signatures
from studies.operate.silhouettes import SilhouetteMatch, silhouettes
from studies.operate.survey import draw_views, seen_views

SHIPS = ("duncan", "roberts", "connole", "horne")  # the first two are sisters
ASPECTS = np.arange(0, 90.1, 0.75).tolist()
TESTS, SEEDS = 288, 3
WINDOW = {"coverage_rule": 0.25, "length": 200.0, "height": 50.0, "depression": 3.84}
IMAGER = Imager()
PULSES, FRAMES = (10e-9, 30e-9), (2, 16, 128)


@cache
def drawn():
    plans = [
        planned_views(ASPECTS, TESTS, np.random.default_rng([5, k])) for k in range(len(SHIPS))
    ]
    meshes = [ncti.ships.load(ship) for ship in SHIPS]
    views = [
        draw_views(mesh, plan["aspects"], spacing=1.0)
        for mesh, plan in zip(meshes, plans, strict=True)
    ]
    return views, [plan["places"] for plan in plans]


@cache
def shares(footprint, slant_range, cnr):
    """Return percent identified of all ships, (seed, pulse, frames, channel)."""
    seen = [
        seen_views(*ship_views, footprint=footprint) for ship_views in zip(*drawn(), strict=True)
    ]
    images = [packed(silhouettes(ship_views, footprint=footprint, **WINDOW)) for ship_views in seen]
    masks = {name: np.stack([image[name] for image in images]) for name in ("shown", "shape")}
    options = {"bin_width": 1.0, "bins": 250, "learned": len(ASPECTS)}
    per_ship = [
        signatures(ship_views, pulse_width=PULSES, cnr=[cnr], **options) for ship_views in seen
    ]
    arrays = {
        name: np.stack([ship_arrays[name][0] for ship_arrays in per_ship], axis=1)
        for name in per_ship[0]
    }
    answers = []
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        answers.append(
            identify(
                arrays,
                match_silhouettes(masks, SHIPS, ASPECTS, TESTS, rng),
                IMAGER,
                Trial(TESTS, 2, 1.0, 4000, 1.0, 1.0),
                cnr=cnr,
                slant_range=slant_range,
                pulse_width=PULSES,
                frame_count=FRAMES,
                fleet=[len(SHIPS)],
                ship=SHIPS,
                aspect=ASPECTS,
                rng=rng,
                valid=np.ones(len(SHIPS), bool),
            )["share"][:, :, 0]
        )
    return 100 * np.array(answers)


def test_fusion_hardly_loses_to_the_better_sensor():
    gains = []
    for setting in ((3.75, 25e3, 10**2.8), (7.5, 25e3, 10**4)):
        share = shares(*setting).mean(axis=0)
        assert share[..., 0].max() > 95 > 90 > share[..., 1].max()  # where fusion is hardest
        gains.append(share[..., 2] - share[..., :2].max(axis=-1))
    # The aim over all settings, in percentage points; gains do not make up for losses.
    assert np.minimum(gains, 0).mean() > -0.1 and np.min(gains) > -1


def densities(seed, samples=5, ships=3, templates=9):
    logs = 30 * np.random.default_rng(seed).standard_normal((samples, ships * templates))
    return logs, relative_densities(logs, ships)


def test_joint_evidence_is_the_mean_over_templates_of_the_product():
    (first_logs, first_density), (second_logs, second_density) = densities(0), densities(1)
    exact = logsumexp((first_logs + second_logs).reshape(5, 3, 9), axis=2) - np.log(9)
    # The bound is several roundings of 2^-24 of 100.
    assert np.allclose(joint_evidence(first_density, second_density), exact, atol=1e-3)
    assert np.array_equal(joint_evidence(first_density), ship_evidence(first_logs, 3))


@pytest.mark.parametrize("templates", [2, 4, 5, 30])
def test_density_over_places_weights_places_equally(templates):
    # One density depends on the place alone, and one is constant.
    of_place = np.array([0.1, 1.0, 0.4, 0.2], dtype=np.float32)
    density = np.tile(np.resize(of_place, templates), (3, 2, 1))
    mean = of_place[:templates].mean()
    assert np.allclose(over_places(density, 4), mean, rtol=1e-6)
    assert np.allclose(over_places(np.ones_like(density), 4), 1, rtol=1e-6)
    assert np.allclose(over_places(density, 1), density, rtol=1e-6)


def test_contradictory_sensors_have_finite_joint_evidence():
    logs = np.array([[0.0, -1e4, -1e4, -1e4, -1e4, -1e4, -1e4, -1e4]])
    best, density = relative_densities(logs, 1)
    sure = relative_densities(logs[:, ::-1], 1)
    assert np.isfinite(joint_evidence(sure, (best, over_places(density, 4)))).all()


def test_inverse_temperature_corrects_fourfold_log_densities():
    rng = np.random.default_rng(0)
    truth = rng.integers(2, size=4000)
    samples = truth + rng.standard_normal(4000)
    logs = -2 * np.square(samples[:, None] - np.arange(2)).astype(np.float32)
    assert fit_inverse_temperature(logs, 2, truth, least=0.01) == pytest.approx(0.25)


def bars(shift):
    """Return silhouettes of two ships of 16 and 20 pixels, which a shift moves on."""
    images = np.zeros((2, 6, 3, 40), bool)
    for ship, length in enumerate((16, 20)):
        for view in range(6):
            images[ship, view, 1, 4 + shift + view : 4 + shift + view + length] = True
    return images


@pytest.mark.parametrize(
    ("shift", "slant_range", "trusted"), [(0, 10e3, 1.0), (6, 10e3, 0.5), (6, 200e3, 1.0)]
)
def test_silhouette_weight_follows_held_out_recognition(shift, slant_range, trusted):
    templates = bars(0)
    conditions = {"imager": IMAGER, "slant_range": slant_range, "gain_sigma": 1.0}
    of_learned, of_others = (
        SilhouetteMatch(templates, templates[:, 0], tests, np.random.default_rng(0)).evidence(
            16, **conditions
        )
        for tests in (templates, bars(shift))
    )
    factor = (of_others / of_learned).mean()
    # They are trusted less only where errors of templates are larger than the noise.
    assert factor == pytest.approx(1.0) if trusted == 1 else factor < trusted
