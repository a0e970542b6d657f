"""Pictures of categories show what the store holds, beside what the source states."""

import warnings
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle
from stores import opened

from sweeps.report import figures, rows
from sweeps.report.axes import nominal
from sweeps.report.formation_figures import (
    PROFILES,
    Run,
    confused_aspects,
    draw_formation,
    runs_of,
    tints_of,
)

# Of the smoke store: group, settings of the strips, draws of the shares, and words of the title.
PICTURES = {
    "formation": (
        "classification/acn_infrared",
        {"vigilance": 0.87},
        {"phase": 0, "order": 0},
        "silhouettes, ACN at vigilance 0.87",
    ),
    "profile_formation": (
        "classification/acn",
        {"vigilance": 0.95},
        {"pulse_width": 1},
        "range profiles, ACN at vigilance 0.95, 30 ns",
    ),
}


@pytest.fixture(scope="module")
def drawn(smoke_store):
    """Both pictures, with any warning as an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = {kind: figures.draw(kind, smoke_store) for kind in PICTURES}
        for figure in made.values():
            figure.canvas.draw()
    return made


def training(categories, confused, aspect):
    dims = ("ship", "aspect")
    return xr.Dataset(
        {"training_category": (dims, categories), "training_confused": (dims, confused)},
        {"ship": ["a", "b"], "aspect": aspect},
    )


def test_runs_join_neighbours_of_one_category_and_end_half_way():
    runs = runs_of(
        training([[0, 0, 1, 0], [2, 2, -1, 1]], [[0, 0, 1, 0], [0, 0, 0, 1]], [0.0, 3.0, 9.0, 12.0])
    )
    assert runs == [
        Run(ship=0, start=-1.5, stop=6.0, category=0, confused=False),
        Run(ship=0, start=6.0, stop=10.5, category=1, confused=True),
        Run(ship=0, start=10.5, stop=13.5, category=0, confused=False),
        Run(ship=1, start=-1.5, stop=6.0, category=2, confused=False),
        Run(ship=1, start=6.0, stop=10.5, category=-1, confused=False),
        Run(ship=1, start=10.5, stop=13.5, category=1, confused=True),
    ]


def test_runs_of_one_aspect_have_a_width():
    (first, _) = runs_of(training([[0], [0]], [[1], [1]], [30.0]))
    assert first.start < 30.0 < first.stop


def test_tints_tell_categories_apart_and_join_shared_ones():
    runs = [
        Run(ship=ship, start=3.0 * place, stop=3.0 * place + 3.0, category=category, confused=both)
        for ship, row in enumerate(([0, 1, 2, 3, 4, 9, 8], [0, 5, 6, -1, 7, 9, 8]))
        for place, category in enumerate(row)
        for both in [category in (0, 9, 8)]
    ]
    tints = tints_of(runs)
    for category in (0, 9, 8):
        assert tints[0, category] == tints[1, category]
    assert tints[1, -1] == to_rgb("white")
    of_categories = {category: tint for (_, category), tint in tints.items()}
    assert len(set(of_categories.values())) == len(of_categories)
    for first, second in pairwise(runs):
        if first.ship == second.ship:
            one, other = (np.array(tints[run.ship, run.category]) for run in (first, second))
            assert np.abs(one - other).max() > 0.1


@pytest.mark.parametrize("kind", PICTURES)
def test_formation_prints_the_stores_categories(kind, drawn, smoke_store):
    name, settings, draws, words = PICTURES[kind]
    classified = nominal(opened(smoke_store, name), keep=("ship", "aspect", *settings, *draws))
    classified = classified.sel(settings)
    first = classified.isel(draws)
    strips, share = [axes for axes in drawn[kind].axes if not hasattr(axes, "_colorbar")]
    bars = [patch for patch in strips.patches if isinstance(patch, Rectangle)]
    written = [text.get_text() for text in strips.texts]
    numbers = [int(text) - 1 for text in written if not text.startswith("source")]
    assert len(bars) == len(numbers)
    seen = np.full((first.sizes["ship"], first.sizes["aspect"]), -1)
    hatched = np.zeros(seen.shape, dtype=int)
    for bar, number in zip(bars, numbers, strict=True):
        left, right = bar.get_x(), bar.get_x() + bar.get_width()
        inside = (first.aspect.values > left) & (first.aspect.values < right)
        ship = round(bar.get_y() + bar.get_height() / 2)
        seen[ship, inside] = number
        hatched[ship, inside] = bar.get_hatch() is not None
    np.testing.assert_array_equal(seen, first.training_category.transpose("ship", "aspect"))
    np.testing.assert_array_equal(hatched, first.training_confused.transpose("ship", "aspect"))

    (mesh,) = share.collections
    expected = 100 * classified.training_confused.mean(list(draws))
    np.testing.assert_allclose(
        np.asarray(mesh.get_array()).ravel(), expected.transpose("ship", "aspect").values.ravel()
    )
    names = [label.get_text().lower() for label in strips.get_yticklabels()]
    assert names == first.ship.values.tolist()
    assert share.get_xlabel() == "aspect [°], 0 bow-on, 90 port beam"
    count = int(first.training_category.max()) + 1
    assert drawn[kind].get_suptitle().startswith(f"{count} categories of 14 {words}")


def four_ships(pulse_widths):
    """Categories as of 124 profiles: all views of the Duncan from 15 deg on are the Horne's, too.

    At 10 ns only from 36 deg on, except the last.
    """
    aspects, ships = np.arange(0.0, 91.0, 3.0), ["duncan", "horne", "spruance", "texas"]
    category = np.zeros((2, 4, 31), dtype=int)
    category[...] = np.arange(1, 5)[:, None]
    category[:, 0] = np.where(aspects < 15, 0, np.where(aspects < 39, 2, 5))
    confused = np.zeros_like(category)
    confused[0, :2] = (aspects >= 36) & (aspects < 90)
    confused[1, :2] = aspects >= 15
    dims = ("pulse_width", "vigilance", "ship", "aspect")
    values = {"training_category": category, "training_confused": confused}
    whole = xr.Dataset(
        {name: (dims, value[:, None]) for name, value in values.items()},
        {"pulse_width": [10.0, 30.0], "vigilance": [0.95], "ship": ships, "aspect": aspects},
    )
    return whole.sel(pulse_width=pulse_widths)


def test_sources_statement_is_beside_what_was_measured():
    several = draw_formation(four_ships([10.0, 30.0]), PROFILES)
    source = rows.source_figures()["figure19_formation"]
    assert several.get_supxlabel().splitlines() == [
        "Duncan in the source's Figure 19: three categories from the bow to about 50°, and "
        "confused ones from there.",
        "Duncan here: 3 categories from the bow to 50°, the first confused one from 15° "
        "(10 ns: from 36°)",
    ]
    marks = [line.get_xdata()[0] for line in several.axes[0].lines]
    assert marks == [source["confused_from"]]
    theirs = rows.source_figures()["table3_categories"]["categories"][30]
    assert several.get_suptitle().endswith(f"the source forms {theirs}")


def test_one_training_has_no_shares_and_says_nothing_of_others():
    one = draw_formation(four_ships([30.0]), PROFILES)
    assert len(one.axes) == 1
    assert one.axes[0].get_xlabel() == "aspect [°], 0 bow-on, 90 port beam"
    assert one.get_supxlabel().endswith("the first confused one from 15°")
    clear = four_ships([30.0])
    clear = clear.assign(training_confused=0 * clear.training_confused)
    said = draw_formation(clear, PROFILES).get_supxlabel()
    assert said.endswith("3 categories from the bow to 50°, none confused")


def test_a_ship_confused_at_one_pulse_width_alone_says_at_which():
    several = four_ships([10.0, 30.0])
    confused = several.training_confused * (several.pulse_width == 10)
    said = draw_formation(several.assign(training_confused=confused), PROFILES).get_supxlabel()
    assert said.endswith("none confused (10 ns: from 36°)")
    confused = several.training_confused * (several.pulse_width == 30)
    said = draw_formation(several.assign(training_confused=confused), PROFILES).get_supxlabel()
    assert said.endswith("the first confused one from 15° (10 ns: none)")


def test_aspects_that_nobody_learned_are_left_out():
    """Drawn at random between the others, they have no category."""
    whole = four_ships([10.0, 30.0])
    fresh = whole.isel(aspect=[3, 20]).assign_coords(aspect=[10.4, 61.7])
    fresh = xr.full_like(fresh, -1)
    mixed = xr.concat([whole, fresh], "aspect").sortby("aspect")
    ours, theirs = (draw_formation(one, PROFILES) for one in (mixed, whole))
    assert ours.get_supxlabel() == theirs.get_supxlabel()
    assert ours.get_suptitle() == theirs.get_suptitle()
    widths = [[bar.get_width() for bar in one.axes[0].patches] for one in (ours, theirs)]
    assert widths[0] == widths[1]


def test_confused_aspects_ascend_whatever_their_order():
    shuffled = four_ships([10.0]).sel(ship="duncan").squeeze().isel(aspect=slice(None, None, -1))
    np.testing.assert_array_equal(confused_aspects(shuffled), np.arange(36.0, 90.0, 3.0))
