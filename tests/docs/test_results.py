"""Published figures have valid intervals, and the pages have the tables that sweeps make."""

import csv
import re

import numpy as np
import pytest
from once import sharing_ships
from scipy import stats

from docs._tables import coverage, pages, repeated, result_flights, results, sweeping
from docs._tables.repeated import bins_of, mean_over_seeds, multiples_mask
from docs._tables.sweeping import choices_of
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.stages.irar import Irar

ENDS = (0.0, 30.0, 60.0, 90.0)
TABULATED = tuple(part for part in results.PARTS if part not in ("flights", "pairs"))
TINY = ("render.pixel=1", "render.samples=100", "classifier.mnn.epochs=5")


def test_interval_has_width_even_if_all_seeds_agree():
    """Wilson's interval of 400 views that are all right begins at 1 / (1 + z^2 / 400)."""
    found = mean_over_seeds(np.full(10, 100.0), views=40)
    assert found.high == found.mean == 100.0
    z = stats.norm.isf(0.025)
    assert found.low == pytest.approx(100 / (1 + z**2 / 400))
    assert found.text() == "100 [99-100]"
    assert mean_over_seeds([1.0, 2.0], bounds=(-5, 5)).text(1, "+") == "+1.5 [-4.9 to +5.0]"


def test_bins_and_multiples_of_a_step():
    aspect = [0.0, 1.5, 29.999, 30.0, 60.0, 89.97, 90.0]
    assert [int(mask.sum()) for mask in bins_of(aspect).values()] == [3, 1, 3, 7]
    assert multiples_mask(aspect, 1.5).tolist() == [True, True, False, True, True, False, True]


@pytest.mark.parametrize(("factor", "least", "most"), [(1.0, 93.0, 97.0), (0.5, 0.0, 80.0)])
def test_coverage_reveals_intervals_that_are_too_narrow(factor, least, most, monkeypatch):
    """1,600 repeats of normal draws give 95 %, +- 2 at five standard errors; half as wide, 66 %."""
    percent = np.random.default_rng(3).normal(50, 4, (1600, 20))
    plain = coverage.mean_over_seeds

    def narrow(values, **how):
        found = plain(values, **how)
        low, high = (found.mean + factor * (end - found.mean) for end in (found.low, found.high))
        return repeated.Interval(found.mean, low, high)

    monkeypatch.setattr(coverage, "mean_over_seeds", narrow)
    assert least <= 100 * coverage.coverage_share(percent, views=40) <= most


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return all tables without flights and pairs of ships, from tiny sweeps of two seeds."""
    folder = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sweeping, "cache_folder", lambda: sharing_ships(folder))
        inline = ClusterChoice(kind="inline")
        # Variants of ships take long to build: unknown ships stand in for them.
        patched.setattr(results, "_variants", lambda ships: results.UNKNOWN_SHIPS)
        small = (2, 2, TINY, ENDS, 1, TABULATED, inline)
        return results.measure(results.Sizes(*small, finest=ENDS, generated=0))


def test_sweeps_include_the_errors_and_ranges_of_the_tables():
    """They have the errors of navigation, and a range for every ship of the validation."""
    errors = choices_of(result_flights.SENSITIVITY)[Irar.errors]
    assert set(result_flights.NAVIGATION_ERRORS) <= set(errors)
    ranges = choices_of(result_flights.NEAR_STERN)[Irar.range]
    assert sorted(result_flights.MISSIONS.values()) == sorted(ranges)


def tables_of(page):
    """Return headings and number of rows of the tables of a page, by name."""
    text = page.read_text(encoding="utf-8")
    found = {}
    for name in re.findall(rf"{pages.PROGRAM} results --write \((\w+)\) -->", text):
        line = pages.begin("results", name)
        table = text.split(line)[1].split(pages.END)[0].strip().splitlines()
        found[name] = [cell.strip() for cell in table[0].strip("|").split("|")], len(table) - 2
    return found


def csv_tables():
    """Return headings and number of rows of the tables in CSV files, by name."""
    found = {}
    for path in (pages.ROOT / "docs" / "tables").glob("results_*.csv"):
        headings, *rows = csv.reader(path.open(encoding="utf-8"))
        found[path.stem.removeprefix("results_")] = headings, len(rows)
    return found


def counted(heading):
    """Return a heading without its counts, and its numbers of seeds and of draws."""
    counts = [int(one) for one in re.findall(r"(\d+) (?:seeds|draws)", heading)]
    return re.sub(r"(\d+ x )?\d+ (seeds|draws|flights)", r"n \2", heading), counts


def test_the_command_writes_the_tables_of_the_pages(made):
    """The pages have the columns and rows that the command makes, of ten seeds at least."""
    printed = tables_of(pages.ROOT / "README.md") | tables_of(pages.ROOT / "docs" / "results.md")
    assert not set(printed) & set(csv_tables())
    found = printed | csv_tables()
    assert set(made) < set(found)
    for name, (headings, rows) in found.items():
        words, counts = counted(headings[0])
        # Each of fifteen pairs has five seeds.
        assert counts and min(counts) >= (results.PAIR_SEEDS if name == "pairs" else 10), name
        if name not in made:
            continue
        wanted = [column.heading for column in made[name].columns]
        assert headings[1:] == wanted[1:], name
        assert words == counted(wanted[0])[0], name
        assert rows == len(made[name].rows), name
