"""Published figures: their intervals, the sweeps behind them, and the pages that have them."""

import itertools
import re

import numpy as np
import pytest
import xarray as xr
from once import sharing_ships
from scipy import stats

from benchmarks import pages, repeated, result_flights, results
from benchmarks.repeated import bins_of, multiples, over_seeds
from benchmarks.sweeping import choices_of
from sweeps.engine.cluster import ClusterChoice
from sweeps.stages.irar import Irar

ENDS = (0.0, 30.0, 60.0, 90.0)
WITHOUT_FLIGHTS = tuple(part for part in results.PARTS if part != "flights")
TINY = (*("render.pixel=1", "render.samples=100", "classifier.mnn.epochs=50"),)

# Of flights:
LANDMARKS = ("stern_to_hangar", "transom_ratio", "deck_spikes", "mast_position", "mast_ratio")
LIKENESS = ("profile_correlation", "profile_correlation_without_hangar")
DRAWS = 2


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
def made(tmp_path_factory):
    """All tables but those of flights, from tiny sweeps of two seeds."""
    folder = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(repeated, "cache_folder", lambda: sharing_ships(folder))
        inline = ClusterChoice(kind="inline")
        return results.measure(results.Sizes(2, 2, TINY, ENDS, 1, WITHOUT_FLIGHTS, inline))


def figures(names, **axes):
    """Figures that are 0.5, and 0.1 more or less in each of two draws."""
    axes = {"replicate": range(DRAWS)} | axes
    shape = [len(values) for values in axes.values()]
    one = xr.DataArray(np.full(shape, 0.5), axes, tuple(axes))
    one = one + xr.DataArray([-0.1, 0.1], {"replicate": range(DRAWS)})
    return xr.Dataset(dict.fromkeys(names, one))


def near():
    gains = {"transom_gain": [0.0, 1.0], "mast_gain": [1.0, 3.0]}
    sources = {"source": ["point", "synthetic", "noiseless", "measured"]}
    one = figures(LANDMARKS, **gains, **sources).merge(figures(LIKENESS, **gains))
    one.stern_to_hangar.loc[{"source": "point"}] = 26.0  # without noise
    return dict.fromkeys(result_flights.MISSIONS, one)


def leaning():
    names = [
        f"{channel}{what}_tilt"
        for channel, what in itertools.product(
            ("", "intensity_", "noiseless_"), ("mast", "waterline")
        )
    ]
    return dict.fromkeys(
        result_flights.FLOWN, figures(names, clutter=list(result_flights.CLUTTERS))
    )


def wrong():
    pairs = [("none", 0.0), *result_flights.WRONG]
    one = figures(LIKENESS[:1], error=range(len(pairs)), autofocus=[False, True])
    parameters, values = zip(*pairs, strict=True)
    return one.assign_coords(error_parameter=("error", list(parameters))).assign_coords(
        error_value=("error", np.array(values, dtype=float))
    )


def identified():
    """Answers of two draws: every second aspect right in the first, all in the other."""
    axes = {
        "replicate": range(DRAWS),
        "kind": list(result_flights.KINDS),
        "classifier": sorted(result_flights.LEARNERS),
        "ship": [*result_flights.FLOWN, "duncan"],
        "aspect": [0.0, 90.0],
    }
    right = xr.DataArray(np.ones([len(values) for values in axes.values()]), axes, tuple(axes))
    right.loc[{"replicate": 0, "aspect": 0.0}] = 0.0
    right.loc[{"kind": "measured", "ship": "duncan"}] = -1.0  # not flown past
    right.loc[{"kind": "test", "ship": "duncan"}] = 0.0
    return xr.Dataset({"ship_correct": right})


@pytest.fixture(scope="module")
def made_of_flights():
    chain = figures((*LIKENESS, "mast_tilt"), chain=["exact", "printed", "printed_pulse_rate"])
    return (
        result_flights.near_stern(near())
        | result_flights.tilts(leaning())
        | result_flights.chains(chain)
        | result_flights.sensitivity(wrong())
        | result_flights.measured(identified())
    )


def test_figures_are_means_over_draws_with_intervals(made_of_flights):
    """Two draws 0.2 apart: Student's t of one degree of freedom is 12.7, times 0.1."""
    row = made_of_flights["sensitivity"].rows[0]
    assert row == {"what": "none", "plain": "0.50 [-0.77-1.00]", "focused": "0.50 [-0.77-1.00]"}
    landmarks = made_of_flights["near_stern"].rows[0]
    assert landmarks["Duncan synthetic, point sampled"] == "26.0"
    assert landmarks["Roberts flown past"] == "0.5 [0.0-1.8]"
    # Of ships that were flown past: 50 and 100 %, 75 in the mean.
    assert {row["acn"] for row in made_of_flights["measured"].rows} == {"75 [0-100]"}


def test_least_and_largest_are_of_all_flights(made_of_flights):
    assert made_of_flights["likeness"].rows[0]["profile_correlation"].endswith("; 0.400")
    tilts = made_of_flights["tilts"].rows
    assert tilts[0]["mast_tilt"] == "0.50 [0.00-1.77]; 0.60"
    assert "intensity_mast_tilt" not in tilts[-1]


def test_sweeps_have_what_the_tables_show():
    """Errors of navigation, and every ship of the validation at a range of its own there."""
    errors = choices_of(result_flights.SENSITIVITY)[Irar.errors]
    assert set(result_flights.WRONG) <= set(errors)
    ranges = choices_of(result_flights.NEAR)[Irar.range]
    assert sorted(result_flights.MISSIONS.values()) == sorted(ranges)


def tables_of(page):
    """Names of the tables of a page, and the headings of each behind the first."""
    text = page.read_text(encoding="utf-8")
    found = {}
    for name in re.findall(r"benchmarks results --write \((\w+)\) -->", text):
        line = pages.begin("results", name)
        table = text.split(line)[1].split(pages.END)[0].strip().splitlines()
        found[name] = [cell.strip() for cell in table[0].strip("|").split("|")], len(table) - 2
    return found


def counted(heading):
    """A heading without its numbers of seeds, draws and flights, and those of seeds and draws."""
    counts = [int(one) for one in re.findall(r"(\d+) (?:seeds|draws)", heading)]
    return re.sub(r"(\d+ x )?\d+ (seeds|draws|flights)", r"n \2", heading), counts


def test_the_command_writes_every_table_of_the_pages(made, made_of_flights):
    """Tables, their columns and rows are those that the command makes, of ten seeds at least."""
    tables = made | made_of_flights
    found = tables_of(pages.ROOT / "README.md") | tables_of(pages.ROOT / "docs" / "results.md")
    assert set(found) == set(tables)
    for name, (headings, rows) in found.items():
        wanted = [column.heading for column in tables[name].columns]
        assert headings[1:] == wanted[1:], name
        words, counts = counted(headings[0])
        assert words == counted(wanted[0])[0], name
        assert counts and min(counts) >= 10, name
        assert rows == len(tables[name].rows), name
