"""Published figures: their intervals, the sweeps behind them, and the pages that have them."""

import re

import numpy as np
import pytest
from scipy import stats

from benchmarks import repeated, results
from benchmarks.repeated import bins_of, multiples, over_seeds
from sweeps.engine.cluster import ClusterChoice

ENDS = (0.0, 30.0, 60.0, 90.0)
TINY = (*("render.pixel=1", "render.samples=100", "classifier.mnn.epochs=50"),)


def seeds_of(rng, experiments, *, seeds, views, draws, hopeless):
    """(experiment, seed) percent correct, and the mean over all seeds.

    A seed draws views; a share of them is nearly always wrong, the others nearly always right.
    """
    bad = rng.random((experiments, seeds, views)) < hopeless
    chance = np.where(bad, 0.1, 0.98)
    right = rng.binomial(draws, chance) / draws
    return 100 * right.mean(axis=2), 100 * (0.1 * hopeless + 0.98 * (1 - hopeless))


@pytest.mark.parametrize(
    ("views", "hopeless"), [(40, 0.2), (120, 0.2), (40, 0.6), (120, 0.5), (40, 0.01), (120, 0.003)]
)
def test_intervals_cover_in_95_of_100_repetitions(views, hopeless):
    """Of 2,000 experiments of all seeds; a binomial test at 1e-4 against 94 %.

    Percentages are no normal variables, hence 94. Where wrong answers are rare, more is covered.
    """
    rng = np.random.default_rng(21)
    found, truth = seeds_of(rng, 2000, seeds=results.SEEDS, views=views, draws=2, hopeless=hopeless)
    intervals = [over_seeds(one, views=views) for one in found]
    covered = sum(one.low <= truth <= one.high for one in intervals)
    assert stats.binom.cdf(covered, 2000, 0.94) > 1e-4, covered
    if hopeless >= 0.2:  # and not by being wide
        assert stats.binom.sf(covered, 2000, 0.965) > 1e-4, covered


def test_seeds_that_agree_are_no_certainty():
    """Wilson's interval of 400 views that are all right begins at 1 / (1 + z^2 / 400)."""
    found = over_seeds(np.full(10, 100.0), views=40)
    assert found.high == found.mean == 100.0
    z = stats.norm.isf(0.025)
    assert found.low == pytest.approx(100 / (1 + z**2 / 400))
    assert found.text() == "100 [99-100]"
    assert over_seeds([1.0, 2.0], bounds=(-5, 5)).text(1, "+") == "+1.5 [-4.9 to +5.0]"


def test_bins_and_multiples_of_a_step():
    aspect = [0.0, 1.5, 29.999, 30.0, 60.0, 89.97, 90.0]
    assert [int(mask.sum()) for mask in bins_of(aspect).values()] == [3, 1, 3, 7]
    assert multiples(aspect, 1.5).tolist() == [True, True, False, True, True, False, True]


@pytest.fixture(scope="module")
def made(tmp_path_factory, cache):
    """All tables, from tiny sweeps of two seeds."""
    folder = tmp_path_factory.mktemp("results")
    (cache / "meshes").mkdir(parents=True, exist_ok=True)
    (folder / "meshes").symlink_to(cache / "meshes")  # ships are built once a machine
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(repeated, "cache_folder", lambda: folder)
        inline = ClusterChoice(kind="inline")
        return results.measure(results.Sizes(2, TINY, ENDS, 1, workers=inline))


def tables_of(page):
    """Names of the tables of a page, and the headings of each behind the first."""
    text = page.read_text(encoding="utf-8")
    found = {}
    for name in re.findall(r"benchmarks results --write \((\w+)\) -->", text):
        table = text.split(results.begin(name))[1].split("<!-- end -->")[0].strip().splitlines()
        found[name] = [cell.strip() for cell in table[0].strip("|").split("|")], len(table) - 2
    return found


def test_the_command_writes_every_table_of_the_pages(made):
    """Tables, their columns and rows are those that the command makes, whatever the figures."""
    pages = tables_of(results.README) | tables_of(results.PAGE)
    assert set(pages) == set(made)
    for name, (headings, rows) in pages.items():
        wanted = [column.heading for column in made[name].columns]
        assert headings[1:] == wanted[1:], name
        assert headings[0] == wanted[0].replace("2 seeds", f"{results.SEEDS} seeds"), name
        assert rows == len(made[name].rows), name


def test_what_is_written_is_what_is_made(made, tmp_path):
    page = tmp_path / "page.md"
    blocks = [f"{results.begin(name)}\n\nold\n<!-- end -->" for name in made]
    page.write_text("\n\n".join(blocks), encoding="utf-8")
    results.write_all(made, lambda name: page)
    text = page.read_text(encoding="utf-8")
    assert "old" not in text
    assert all(row["what"] in text for report in made.values() for row in report.rows)
