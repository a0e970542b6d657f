"""Parameters that the article leaves open are drawn by their priors, from one series."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats.qmc import Sobol

from studies.reproduction.assumptions import CLASSES, PRIORS, Choice, Interval, assumed

NUMBERS = {name: prior for name, prior in PRIORS.items() if isinstance(prior, Interval)}
WORDS = {name: prior for name, prior in PRIORS.items() if isinstance(prior, Choice)}


def test_setting_is_a_point_of_one_sobol_sequence():
    """A series drawn at once has the same settings."""
    series = Sobol(len(PRIORS), scramble=True, seed=7).random(16)
    for number in (0, 1, 6, 15):
        values = assumed(number, seed=7)
        shares = [NUMBERS[name].share(values[name]) for name in NUMBERS]
        is_number = [name in NUMBERS for name in PRIORS]
        np.testing.assert_allclose(shares, series[number, is_number], atol=1e-12)
    assert assumed(3, seed=7) != assumed(3, seed=8)


def test_draw_frequencies_follow_the_prior():
    """256 points of the sequence lie evenly on every axis, in any 256 parts of it."""
    draws = [assumed(number) for number in range(256)]
    for name, prior in NUMBERS.items():
        classes = prior.classes([values[name] for values in draws])
        assert np.bincount(classes).tolist() == [256 // CLASSES] * CLASSES, name
    for name, prior in WORDS.items():
        counts = [sum(values[name] == word for values in draws) for word in prior.values]
        assert max(counts) - min(counts) <= 2, name


@pytest.mark.parametrize("name", NUMBERS)
@given(share=st.floats(0, 1, exclude_max=True))
def test_shares_and_values_are_inverse(name, share):
    prior = NUMBERS[name]
    value = prior.at(share)
    slack = 1e-9 * (prior.high - prior.low)
    assert prior.low - slack <= value <= prior.high + slack
    assert prior.share(value) == pytest.approx(share, abs=1e-9)
    assert 0 <= prior.classes(value) < CLASSES


def test_median_of_a_logarithmic_prior_is_the_geometric_mean():
    assert Interval(1.0, 100.0, "", "", logarithmic=True).at(0.5) == pytest.approx(10.0)


@pytest.mark.parametrize("name", WORDS)
def test_categorical_values_are_numbered_in_order(name):
    prior = WORDS[name]
    for index, value in enumerate(prior.values):
        assert prior.at((index + 0.5) / len(prior.values)) == value
        assert prior.number(value) == index == prior.classes(prior.number(value))
