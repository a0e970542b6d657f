"""Random aspects and generated ships are in the grid, not learned, and counted apart."""

import numpy as np
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from range_channel import choose

from ncti.evaluate.answers import accuracy_columns
from ncti.ships.perturbation import Variant
from sweeps.stages import classifier, likelihood
from sweeps.stages.classifier import (
    Classifier,
    aspect_masks,
    draw_aspects,
    generated_ships,
    random_test_aspects,
    training_ship_mask,
    training_view_mask,
)
from sweeps.stages.views import Grid

SHIPS = {"grid__ship": ["duncan", "horne"]}


def chosen(**settings):
    """Return choices with the drawn aspects and ships in the grid."""
    choices = choose(**SHIPS | settings)
    return classifier.check(likelihood.check_first(choices) or choices)


@given(
    ends=st.lists(st.floats(0, 359), min_size=2, max_size=2, unique=True).map(sorted),
    number=st.integers(0, 20),
    more=st.integers(0, 5),
    seed=st.integers(0, 2**32),
)
def test_each_30_degree_bin_has_equally_many_random_aspects(ends, number, more, seed):
    low, high = ends
    drawn = np.array(draw_aspects(low, high, number, seed))
    bins = np.arange(30 * (low // 30), high, 30)
    assert drawn.size == number * bins.size
    for part, start in zip(drawn.reshape(bins.size, number), bins, strict=True):
        first, last = max(low, start), min(high, start + 30)
        assert ((first - 1e-3 <= part) & (part <= last + 1e-3)).all()
    # A larger number of draws begins with the same aspects.
    longer = np.array(draw_aspects(low, high, number + more, seed)).reshape(bins.size, -1)
    np.testing.assert_array_equal(longer[:, :number], drawn.reshape(bins.size, number))


def test_random_aspects_join_the_grid_but_not_the_training():
    choices = chosen(grid__aspect=[0, 15, 30, 60], grid__random_aspects=2)
    drawn = random_test_aspects(choices, (0, 15, 30, 60))
    assert len(drawn) == 4 and choices[Grid.aspect] == tuple(sorted({0, 15, 30, 60, *drawn}))
    kinds = aspect_masks(choices)
    assert list(kinds) == ["learned", "random"]
    aspects = np.array(choices[Grid.aspect])
    np.testing.assert_array_equal(aspects[kinds["random"]], sorted(drawn))
    # New draws do not depend on aspects already drawn.
    again = classifier.check(choices)
    assert again.values == choices.values


def test_generated_ships_join_the_grid_as_the_alternative():
    """Each ship learned has variants of sizes between 0.7 and 1.1, which no other ship changes."""
    settings = {"grid__ship": ["duncan", "texas", "roberts"], "classifier__unknown": ["roberts"]}
    settings["classifier__name"] = ["likelihood"]
    choices = chosen(**settings, classifier__generated=3)
    generated = choices.value(Classifier.alternative)
    assert len(generated) == 6 and {name.partition("@")[0] for name in generated} == {
        "duncan",
        "texas",
    }
    assert choices[Grid.ship] == tuple(sorted({"duncan", "texas", "roberts", *generated}))
    assert choices.value(Classifier.unknown) == tuple(sorted({"roberts", *generated}))
    assert training_ship_mask(choices).sum() == 2
    assert likelihood.check_first(choices).values == choices.values
    # The first variants do not depend on the numbers of variants and of ships.
    many = generated_ships(["texas"], 200)
    assert set(many[:3]) < set(generated)
    sizes = np.array([Variant.parse(name).size for name in many])
    # Log-uniform: three distances make a sequence of the golden ratio's steps of 1/n and 2/n.
    share = np.sort(np.log(sizes / 0.7) / np.log(1.1 / 0.7))
    np.testing.assert_allclose(
        share, (np.arange(200) + 0.5) / 200, atol=2 / 200 + 2e-3
    )  # names have three digits


def test_template_spacing_selects_its_multiples_and_is_an_axis():
    spaced = {"grid__aspect": {"start": 0, "stop": 6, "step": 0.5}}
    choices = chosen(**spaced, grid__random_aspects=1, classifier__template_spacing=[1.5, 3])
    learned = training_view_mask(choices)
    assert learned.dims == ("template_spacing", "ship", "aspect")
    aspects = np.array(choices[Grid.aspect])
    for spacing in (1.5, 3.0):
        views = learned.sel(template_spacing=spacing)
        for ship in views:
            np.testing.assert_array_equal(aspects[ship], np.arange(0, 6.1, spacing))
    kinds = aspect_masks(choices)
    assert list(kinds) == ["learned", "between", "random"]
    assert (sum(kind.astype(int) for kind in kinds.values()) == 1).all()


def test_answers_are_counted_per_kind_of_aspect():
    rng = np.random.default_rng(2)
    dims, coords = ("replicate", "ship", "aspect"), {"aspect": [0.0, 1.0, 30.0, 31.0, 62.0]}
    answers = rng.integers(0, 2, (3, 2, 5))
    answers[:, 1, 3] = -1  # a view that failed
    correct = xr.DataArray(answers, coords, dims)
    flags_by_kind = {"learned": [1, 0, 1, 0, 0], "random": [0, 1, 0, 1, 1]}
    kinds = {
        name: xr.DataArray(np.array(flags, bool), dims="aspect")
        for name, flags in flags_by_kind.items()
    }
    table = accuracy_columns(correct, "", "tests", kinds)
    share, n = table.accuracy, table.n
    assert share.aspects.values.tolist() == ["learned", "random"]
    for name, flags in flags_by_kind.items():
        answers_of_kind = correct.values[..., np.array(flags, bool)]
        assert n.sel(aspects=name, aspect_bin="overall") == (answers_of_kind >= 0).sum()
        expected = (answers_of_kind == 1).sum() / (answers_of_kind >= 0).sum()
        np.testing.assert_allclose(share.sel(aspects=name, aspect_bin="overall"), expected)
    assert np.isnan(share.sel(aspects="learned", aspect_bin="62"))
    # Without kinds there is no such dimension.
    assert "aspects" not in accuracy_columns(correct, "", "tests", {}).dims
