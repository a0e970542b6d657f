"""Settings are compared with the article's figures by variances and correlations."""

import numpy as np
import pytest

from ncti.article import article_figures, figure_order, figures
from studies.reproduction.agreement import binomial_variance
from studies.reproduction.assumptions import PRIORS, assumed
from studies.reproduction.fits import FITS, Agreement


def compared(mean, value=None, **overrides):
    value = np.zeros((len(mean), len(PRIORS))) if value is None else value
    uncertainty = {"spread": np.zeros_like(mean), "draws": 4} | overrides
    return Agreement(figures(), mean, value=value, **uncertainty)


def article():
    return np.array([figure.value for figure in figures()])


def test_article_figures_follow_the_order_of_simulated_tables():
    tables = article_figures()
    by_row = {
        **{n: [table["training"], *table["frames"].values()] for n, table in (
            ("table2", tables["table2_percent_correct"]),
            ("table4", tables["table4_percent_correct"]),
        )},
        "table3": list(tables["table3_categories"]["categories"].values()),
        "table5": [
            tables["table5_percent_correct"]["none"][25],
            tables["table5_percent_correct"]["perfect"][50],
            tables["table5_percent_correct"]["none"][50],
        ],
        "categories5": [tables["table5_percent_correct"]["categories"]],
    }  # fmt: skip
    np.testing.assert_array_equal(figure_order(by_row), article())
    trials = [figure.trials for figure in figures()]
    assert trials[:3] == [40, 40, 44] and sum(count == 0 for count in trials) == 4
    names = {(figure.table, figure.name) for figure in figures()}
    assert len(names) == len(figures())


def test_variances_add_binomial_and_simulation_error():
    spread = np.full((1, len(article())), 3.0)
    settings = compared(article()[None], spread=spread)
    for figure, variance in zip(figures(), settings.variance[0], strict=True):
        article_variance = (
            binomial_variance(figure.value, figure.trials) if figure.trials else 1 + 3.0**2
        )
        assert variance == pytest.approx(article_variance + 3.0**2 / 4)


def test_averages_of_shared_frames_are_correlated():
    """Within a table and bin they vary as averages of a random walk; no others vary together."""
    agreement = compared(article()[None])
    names = [f"{figure.table}, {figure.name}" for figure in agreement.figures]

    def between(first, second):
        return agreement.correlation[names.index(first), names.index(second)]

    assert between("2, 8 frames, 0-27°", "2, 16 frames, 0-27°") == pytest.approx(0.75 / 2)
    assert between("4, 32 frames, 60-90°", "4, 8 frames, 60-90°") == pytest.approx(0.75 / 3)
    for name in ("2, 16 frames, 30-57°", "4, 16 frames, 0-27°", "2, training, 0-27°"):
        assert between("2, 8 frames, 0-27°", name) == 0
    assert np.count_nonzero(agreement.correlation) == len(names) + 2 * 3 * 4 * 3
    np.testing.assert_array_equal(agreement.correlation, agreement.correlation.T)


def test_correlated_deviations_reduce_the_distance():
    up = article()[None].copy()
    rows = [figure.table == 4 and figure.frames > 0 for figure in figures()]
    up[:, rows] += 10
    together = compared(up).distance((4,))
    separate = ((compared(up).article - up) ** 2 / compared(up).variance)[:, rows].sum()
    assert 0.4 * separate < together < 0.7 * separate


def test_setting_equal_to_the_article_is_fitted_for_any_tables():
    rng = np.random.default_rng(1)
    mean = np.clip(article() + rng.normal(0, 25, (200, len(article()))), 0, 100)
    mean[17] = article()
    settings = compared(mean)
    assert set(settings.fits) == set(FITS)
    for name, tables in FITS.items():
        assert settings.distance(tables)[17] == 0
        weight = settings.fits[name].weight
        assert weight.argmax() == (17 if tables else 0)
    parts = sum(settings.distance((table,)) for table in (2, 3, 4, 5))
    np.testing.assert_allclose(parts, settings.distance((2, 3, 4, 5)))


def test_only_influential_parameters_gain_information():
    """Figures follow one number and one word; all other parameters have the bits of chance."""
    draws = [assumed(number) for number in range(512)]
    value = np.array([[PRIORS[n].number(draw[n]) for n in PRIORS] for draw in draws])
    names = list(PRIORS)
    radius = PRIORS["inner_radius"].share(value[:, names.index("inner_radius")])
    order = value[:, names.index("order")]
    mean = np.clip(article() + 60 * (radius - 0.4)[:, None] + 30 * order[:, None], 0, 100)
    settings = compared(mean, value)
    bits = dict(zip(names, settings.information(settings.fits["all"]), strict=True))
    assert bits.pop("order") > 1 and bits.pop("inner_radius") > 1
    chance = 8 / (2 * np.log(2) * settings.fits["all"].effective)
    assert max(bits.values()) < 4 * chance and settings.fits["all"].effective >= 49
    assert np.abs(settings.information(settings.fits["none"])).max() < 1e-12
