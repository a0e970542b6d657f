"""Aspects that nobody learns: drawn from the seed, tested apart from those that are learned."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from range_channel import choose

from sweeps.engine.errors import ConfigurationError
from sweeps.stages import classifier
from sweeps.stages.classifier import aspects_of, learned_of
from sweeps.stages.fresh import drawn_aspects, fresh_aspects
from sweeps.stages.scores import by_aspects, scored
from sweeps.stages.views import Grid

SHIPS = {"grid__ship": ["duncan", "horne"]}


def chosen(**settings):
    """Choices with the drawn aspects in the grid."""
    return classifier.check(choose(**SHIPS, **settings))


@given(
    ends=st.lists(st.floats(0, 359), min_size=2, max_size=2, unique=True).map(sorted),
    number=st.integers(0, 20),
    more=st.integers(0, 5),
    seed=st.integers(0, 2**32),
)
def test_every_thirty_degrees_have_as_many_within_the_ends(ends, number, more, seed):
    low, high = ends
    found = np.array(drawn_aspects(low, high, number, seed))
    bins = np.arange(30 * (low // 30), high, 30)
    assert found.size == number * bins.size
    for part, start in zip(found.reshape(bins.size, number), bins, strict=True):
        first, last = max(low, start), min(high, start + 30)
        assert ((first - 1e-3 <= part) & (part <= last + 1e-3)).all()
    # More of them begin with the same.
    longer = np.array(drawn_aspects(low, high, number + more, seed)).reshape(bins.size, -1)
    np.testing.assert_array_equal(longer[:, :number], found.reshape(bins.size, number))


def test_they_are_uniform_and_other_ones_of_another_seed():
    """Kolmogorov-Smirnov, 3,000 aspects, at a level of 1e-3 for this one seed."""
    from scipy.stats import kstest

    found = np.array(drawn_aspects(0.0, 90.0, 1000, 3))
    assert kstest(found / 90, "uniform").pvalue > 1e-3
    assert not set(found) & set(drawn_aspects(0.0, 90.0, 20, 4)[:5])


def test_no_two_bins_draw_the_same_places():
    """Of 20 aspects to a thousandth of 30 degrees, one in 30,000 pairs is equal by chance."""
    places = np.array(drawn_aspects(0.0, 90.0, 20, 3)).reshape(3, 20) % 30
    for first, second in ((0, 1), (0, 2), (1, 2)):
        assert (np.abs(places[first] - places[second]) > 2e-3).sum() >= 18


def test_they_come_into_the_grid_and_are_not_learned():
    choices = chosen(grid__aspect=[0, 15, 30, 60], grid__fresh=2)
    drawn = fresh_aspects(choices, (0, 15, 30, 60))
    assert len(drawn) == 4 and choices[Grid.aspect] == tuple(sorted({0, 15, 30, 60, *drawn}))
    kinds = aspects_of(choices)
    assert list(kinds) == ["learned", "random"]
    aspects = np.array(choices[Grid.aspect])
    np.testing.assert_array_equal(aspects[kinds["random"]], sorted(drawn))
    # What is drawn does not depend on what is drawn already.
    again = classifier.check(choices)
    assert again.values == choices.values


def test_nothing_changes_without_them():
    choices = choose(**SHIPS, grid__aspect=[0, 15])
    assert classifier.check(choices).values == choices.values
    assert list(aspects_of(choices)) == ["learned"]


def test_a_spacing_learns_its_multiples_and_is_an_axis():
    spaced = {"grid__aspect": {"start": 0, "stop": 6, "step": 0.5}}
    choices = chosen(**spaced, grid__fresh=1, classifier__template_spacing=[1.5, 3])
    learned = learned_of(choices)
    assert learned.dims == ("template_spacing", "ship", "aspect")
    aspects = np.array(choices[Grid.aspect])
    for spacing in (1.5, 3.0):
        views = learned.sel(template_spacing=spacing)
        for ship in views:
            np.testing.assert_array_equal(aspects[ship], np.arange(0, 6.1, spacing))
    kinds = aspects_of(choices)
    assert list(kinds) == ["learned", "between", "random"]
    assert (sum(kind.astype(int) for kind in kinds.values()) == 1).all()


def test_one_aspect_has_nothing_to_draw_between():
    said = r"^grid\.fresh is 3, but must be 0 where grid\.aspect has one value"
    with pytest.raises(ConfigurationError, match=said):
        chosen(grid__aspect=10, grid__fresh=3)


def test_a_spacing_that_leaves_nothing_is_refused():
    said = r"^classifier\.template_spacing has 7, but must have a multiple among the aspects"
    with pytest.raises(ConfigurationError, match=said):
        chosen(grid__aspect=[1, 2, 3], classifier__template_spacing=[1, 7])


def test_answers_at_several_kinds_of_aspects_are_counted_apart():
    rng = np.random.default_rng(2)
    dims, coords = ("replicate", "ship", "aspect"), {"aspect": [0.0, 1.0, 30.0, 31.0, 62.0]}
    answers = rng.integers(0, 2, (3, 2, 5))
    answers[:, 1, 3] = -1  # a view that failed
    correct = xr.DataArray(answers, coords, dims)
    where = {"learned": [1, 0, 1, 0, 0], "random": [0, 1, 0, 1, 1]}
    kinds = {
        name: xr.DataArray(np.array(flags, bool), dims="aspect") for name, flags in where.items()
    }
    found = by_aspects(correct, kinds, lambda part: scored(part, "", "tests"))
    share, n = found["accuracy"][0], found["n"][0]
    assert share.aspects.values.tolist() == ["learned", "random"]
    for name, flags in where.items():
        asked = correct.values[..., np.array(flags, bool)]
        assert n.sel(aspects=name, aspect_bin="overall") == (asked >= 0).sum()
        wanted = (asked == 1).sum() / (asked >= 0).sum()
        np.testing.assert_allclose(share.sel(aspects=name, aspect_bin="overall"), wanted)
    assert np.isnan(share.sel(aspects="learned", aspect_bin="62"))
    # Of one kind there is no such dimension.
    assert "aspects" not in by_aspects(correct, {}, lambda part: scored(part, "", "x"))["n"][0].dims
