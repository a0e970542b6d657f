"""Line-to-line speckle correlation matches simulated rough surfaces, and so do drawn lines."""

import math

import numpy as np
import pytest
from flown import flight
from scipy import stats

from ncti.irar.flight import WAVELENGTH
from ncti.irar.speckle import speckle, speckle_correlation


def rough_surface(flown, lines, *, surfaces, scatterers=400, seed=0):
    """Return fields of successive lines off rough surfaces across the sight (surface, line).

    A field sums phasors of scatterers at random places by their exact two-way paths, weighted by
    beam and receiver, each of 1/e^2 intensity diameter phi R, about the current beam centre.
    """
    rng = np.random.default_rng(seed)
    step = flown.snapshot_axes @ flown.to_ship @ flown.velocity / flown.line_rate
    waist = flown.pixel / 2
    places = rng.uniform(-2 * waist, 2 * waist, (surfaces, scatterers, 2))
    phase = rng.uniform(0, 2 * math.pi, (surfaces, scatterers))
    fields = []
    for line in range(lines):
        moved = line * step
        across = ((places - moved[:2]) ** 2).sum(axis=-1)
        away = flown.slant_range - moved[2]
        path = across / (away + np.sqrt(away**2 + across))  # beyond the distance itself
        weight = np.exp(-2 * across / waist**2)
        fields.append((weight * np.exp(1j * (phase + 4 * math.pi * path / WAVELENGTH))).sum(-1))
    return np.stack(fields, axis=-1)


@pytest.mark.parametrize(
    ("speed", "ifov"),
    [(0.5, 205e-6), (15.0, 205e-6), (50.0, 20e-6)],
)
def test_speckle_correlation_matches_simulated_rough_surface(speed, ifov):
    """Allow 4 standard errors sqrt((1 - mu^2) / 2 / 4000) of 4,000 surfaces (level 1e-4).

    The wavefront's curvature is the same in both lines and cancels. With a wide beam the phase
    tilt decorrelates the lines; with one of 20 urad the displacement of the footprint does.
    """
    flown = flight(offset=5.0, aircraft_speed=speed, ship_speed=0.0, ifov=ifov)
    mu = speckle_correlation(flown)
    fields = rough_surface(flown, 3, surfaces=4000, seed=int(10 * speed))
    power = np.mean(np.abs(fields) ** 2)
    for lag, expected in ((1, mu), (2, mu**4)):
        measured = np.abs(np.mean(fields[:, lag] * fields[:, 0].conj())) / power
        level = (
            4 * math.sqrt((1 - expected**2) / 8000) + 5e-3
        )  # 400 scatterers, not infinitely many
        assert measured == pytest.approx(expected, abs=level)


@pytest.mark.parametrize("mu", [0.0, 0.3, 0.8, 0.99])
def test_drawn_lines_are_a_markov_sequence(mu):
    """200 lines in 2,000 columns have correlation mu^k at lag k, unit power and uniform phase.

    Each pair of lines gives 2,000 independent products; means over pairs are known to a standard
    error of 1 / sqrt(2000) or better, four of which are allowed.
    """
    drawn = speckle((200, 1000, 2), correlation=mu, rng=np.random.default_rng(7)).reshape(200, -1)
    assert drawn.dtype == np.complex64
    level = 4 / math.sqrt(2000)
    assert np.mean(np.abs(drawn[0]) ** 2) == pytest.approx(1, abs=level)
    assert np.mean(np.abs(drawn[-1]) ** 2) == pytest.approx(1, abs=level)
    for lag in (1, 2, 5):
        correlation = np.mean(drawn[lag:] * drawn[:-lag].conj())
        assert correlation == pytest.approx(mu**lag, abs=level)
    assert abs(np.mean(drawn**2)) < level
    for line in (0, 199):
        assert stats.kstest(np.abs(drawn[line]) ** 2, "expon").pvalue > 1e-3
    across = drawn.reshape(200, 1000, 2)
    assert abs(np.mean(across[:, :, 0] * across[:, :, 1].conj())) < level
    assert abs(np.mean(across[:, 1:] * across[:, :-1].conj())) < level
