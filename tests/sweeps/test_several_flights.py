"""Several flights in one store: each has its row, and titles tell which one is meant."""

import io
import re
import warnings

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

from ncti.evaluate import wilson_interval
from sweeps.axes import OF_FLIGHT
from sweeps.flight_schema import FlightConfig
from sweeps.flight_variables import KINDS, OF_VIEWS, SOURCES
from sweeps.report.flight_figures import draw_measured, draw_sensitivity, draw_validation
from sweeps.report.flight_words import column, heading
from sweeps.report.flights import LANDMARKS, flight_rows, print_flights
from sweeps.report.measured import measured_rows, print_measured
from sweeps.tabulation import tabulate_answers

IMAGES = ("intensity", "range_image", "infrared_image", "signature")
DOWN_RANGE = np.arange(-60.0, 61.0)


def with_axes(dims, axes):
    """Coordinates: those axes, and every other one with its first value of the configuration."""
    grid = FlightConfig().expand()
    scalars = {
        name: 0 if name == "error" else getattr(grid, name)[0] for name in (*OF_FLIGHT, "replicate")
    }
    scalars = {name: np.nan if value is None else value for name, value in scalars.items()}
    errors = axes.get("errors", [("none", 0.0)])
    along = ("error",) if len(errors) > 1 else ()
    values = {"error": range(len(errors))} | axes if along else dict(axes)
    values.pop("errors", None)
    coords = scalars | {name: (name, list(value)) for name, value in values.items()}
    for k, name in enumerate(("error_parameter", "error_value")):
        array = np.array([error[k] for error in errors], dtype=(object, float)[k])
        coords[name] = (along, array if along else array[0])
    sizes = {name: len(value) for name, value in values.items()}
    return coords, {name: sizes[name] for name in dims if name in sizes}


def validation(seed=0, **axes):
    """A store's flights with made-up figures."""
    axes = {
        "ship": ["roberts", "duncan"],
        "aspect": [175.0],
        "range": [3.9],
        "source": SOURCES,
        "down_range": DOWN_RANGE,
    } | axes
    rng = np.random.default_rng(seed)
    data = {}
    for name, dims, _, *_ in OF_VIEWS:
        if name not in IMAGES:
            coords, sizes = with_axes(dims, axes)
            data[name] = (tuple(sizes), rng.uniform(0.1, 0.9, tuple(sizes.values())))
    return xr.Dataset(data, coords)


def answers(seed=0, **axes):
    """A store's answers, right by chance; those of synthetic profiles the same of all flights."""
    axes = {
        "pulse_width": [10.0, 30.0],
        "classifier": ["acn", "correlation"],
        "vigilance": [0.95],
        "range": [3.0],
        "kind": KINDS,
        "ship": ["roberts", "duncan"],
        "aspect": [10.0, 20.0, 100.0],
    } | axes
    dims = ("pulse_width", "classifier", "vigilance", "range", *OF_FLIGHT, "replicate")
    coords, sizes = with_axes((*dims, "kind", "ship", "aspect"), axes)
    rng = np.random.default_rng(seed)
    right = rng.integers(0, 2, tuple(sizes.values()), dtype=np.int8)
    array = xr.DataArray(right, dims=tuple(sizes))
    synthetic = array.isel({name: 0 for name in ("cnr", "range") if name in array.dims})
    same = xr.broadcast(synthetic, array)[0].transpose(*array.dims)
    measured = np.arange(len(KINDS)) == KINDS.index("measured")
    array = xr.where(xr.DataArray(measured, dims="kind"), array, same).transpose(*array.dims)
    return xr.Dataset({"correct": array, "ship_correct": array}, coords)


def printed(write, what, width=100):
    console = Console(file=io.StringIO(), width=width)
    write(what, console)
    return console.file.getvalue()


def cells_of(line):
    return [cell.strip() for cell in line.strip("│┃\n ").split("│")]


def test_every_flight_has_its_row_among_those_named():
    tables = tabulate_answers(answers(cnr=[5.0, 20.0], range=[3.0, 4.0]))
    rows = measured_rows(tables)
    text = printed(print_measured, rows)
    found = [cells_of(line) for line in text.splitlines() if "│ measured" in line]
    # pulse, classifier, range, cnr, kind, and the bins.
    expected = [
        (f"{width:g}", name.upper() if name == "acn" else name, f"{km:g}", f"{cnr:g}")
        for width in (10, 30)
        for name in ("acn", "correlation")
        for km in (3, 4)
        for cnr in (5, 20)
    ]
    assert [tuple(line[:4]) for line in found] == expected
    for line in found:
        at = {
            "pulse_width": float(line[0]),
            "classifier": line[1].lower(),
            "range": float(line[2]),
            "cnr": float(line[3]),
            "kind": "measured",
        }
        here = tables.sel(at).isel(vigilance=0)
        for label, shown in zip(tables.aspect_bin.values, line[5:], strict=True):
            one = here.sel(aspect_bin=label)
            middle, low, high = (
                100 * float(one[name]) for name in ("ship_accuracy", "ship_ci_low", "ship_ci_high")
            )
            figures = [float(figure) for figure in re.findall(r"\d+", shown)]
            # A percent, of a tenth.
            assert figures == pytest.approx([middle, low, high], abs=0.56)
    # What is the same of all flights stands in one row.
    learned = [cells_of(line) for line in text.splitlines() if "│ learned" in line]
    assert [line[2:4] for line in learned] == [["all", "all"]] * 4


def test_draws_are_counted_together():
    """n counts them all; the interval is wider than of as many independent answers, if anything."""
    given = answers(replicate=[0, 1, 2], ship=["roberts"])
    rows = measured_rows(tabulate_answers(given))
    pool = given.ship_correct.stack(all=["ship", "aspect", "replicate"])
    for row in rows:
        at = {"pulse_width": row["pulse_width_ns"], "classifier": row["classifier"]}
        if row["aspect_bin_deg"] != "overall":
            continue
        right = pool.sel(at | {"kind": row["kind"]}).values.ravel()
        assert row["n"] == right.size == 9
        assert row["ship_percent_correct"] == pytest.approx(100 * right.mean(), abs=0.051)
        low, high = wilson_interval(right.sum(), right.size)
        assert row["ship_ci_low"] <= 100 * low + 0.051
        assert row["ship_ci_high"] >= 100 * high - 0.051


def test_vigilances_have_rows_where_they_matter():
    given = answers(vigilance=[0.9, 0.95])
    given["ship_correct"][{"classifier": 1}] = given.ship_correct.isel(classifier=1, vigilance=0)
    text = printed(print_measured, measured_rows(tabulate_answers(given)))
    lines = [cells_of(line) for line in text.splitlines() if "│ measured" in line]
    assert [line[2] for line in lines] == ["0.9", "0.95", "all"] * 2


def test_titles_of_sensitivities_name_the_flight():
    errors = [("none", 0.0), ("ship_heading", 5.0)]
    flights = validation(
        errors=errors, cnr=[10.0, 20.0], ship=["roberts"], mirror=["exact", "none"]
    )
    text = printed(print_flights, flights)
    for cnr in (10, 20):
        for mirror in ("exact", "none"):
            words = f"roberts, aspect 175 deg, 3.9 km, cnr {cnr} dB, mirror {mirror}"
            assert words in " ".join(text.split())
    title = draw_sensitivity(flights).get_suptitle()
    assert title == "Roberts at 3.9 km, aspect 175°, cnr 10 dB, mirror exact"


def test_a_flight_that_is_drawn_is_named():
    figure = draw_validation(validation(cnr=[10.0, 20.0], pointing=[np.nan, 4.0]))
    for axes in figure.axes:
        assert "cnr 10 dB" in axes.get_title() and "pointing –" in axes.get_title()
    figure = draw_validation(validation(replicate=[0, 1, 2]))
    assert "first of 3 draws" in figure.axes[0].get_title()
    tables = tabulate_answers(answers(cnr=[5.0, 20.0], vigilance=[0.9, 0.95]))
    assert draw_measured(tables).get_suptitle() == "cnr 5 dB, vigilance 0.9"
    assert draw_measured(tabulate_answers(answers())).get_suptitle() == ""


@pytest.mark.parametrize("nothing", [0.0, np.nan])
def test_a_flight_that_sees_nothing_is_a_flat_line(nothing, tmp_path):
    flights = validation()
    flights["profile"][{"source": SOURCES.index("measured")}] = 0.0
    if np.isnan(nothing):  # nor does anything return without noise
        flights["profile"][:] = 0.0
    flights["profile_correlation"][:] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = draw_validation(flights)
        figure.savefig(tmp_path / "flat.png")
    line = figure.axes[0].lines[0]
    assert np.array_equal(line.get_ydata(), np.zeros(DOWN_RANGE.size))
    assert "nothing seen" in figure.axes[0].get_title()


def test_ships_that_are_not_flown_past_are_not_drawn():
    flights = validation(ship=["duncan", "spruance", "roberts"])
    for name in ("duncan", "spruance"):
        for array in flights.data_vars.values():
            array[{"ship": flights.ship.values.tolist().index(name)}] = np.nan
    figure = draw_validation(flights)
    assert [axes.get_title().split()[0] for axes in figure.axes] == ["Roberts"]


MANY = {
    "cnr": [-10.0, 20.0],
    "aircraft_heading": [0.0, 120.0],
    "range_filter": ["cluster", "histogram_of_all"],
    "pulse_rate": [20_000.0, 123_456.0],
    "transom_gain": [0.0, 1.0],
    "autofocus": [False, True],
    "mirror_angle": [44.5, 45.5],
}


@pytest.mark.parametrize("width", [40, 80, 100, 300])
def test_no_word_and_no_figure_is_cut(width):
    flights = validation(**MANY, ship=["roberts"], replicate=[0, 1])
    text = printed(print_flights, flights, width)
    assert "…" not in text
    table = text[: text.index("Means over draws")]
    words = [word for name in MANY for word in heading(name).split()]
    for word in (*words, "correlation", "waterline", "hangar", "looks", "histogram of all"):
        assert re.search(rf"[\s┃│]{re.escape(word)}[\s┃│]", table), word
    rows = [line for line in table.splitlines() if line.startswith("│")]
    assert len(rows) == 2 ** len(MANY)  # a line each: no value is folded
    named = measured_rows(tabulate_answers(answers(**{"cnr": MANY["cnr"], "chain": ["a_b", "c"]})))
    text = printed(print_measured, named, width)
    assert "…" not in text and "a b" in text and "[dB]" in text


def test_landmarks_of_a_ship_without_her_sister_stand_beside_herself_noiseless():
    flights = validation(ship=["connole", "roberts"], cnr=[10.0, 20.0])
    text = printed(print_flights, flights)
    assert "Near stern: Roberts, flown past, 3.9 km, cnr 10 dB" in " ".join(text.split())
    one = flights.sel(ship="roberts").isel(aspect=0, range=0, cnr=0)
    for name, (words, digits, _) in LANDMARKS.items():
        figures = [
            f"{float(one[name].sel(source=k)):.{digits}f}" for k in ("noiseless", "measured")
        ]
        lines = [cells_of(line) for line in text.splitlines() if words in line]
        assert any(line[2:] == figures for line in lines), name
    # Nothing is put in.
    assert "inputs, no results" not in text


def test_ships_of_another_class_have_no_landmarks():
    text = printed(print_flights, validation(ship=["connole", "spruance"]))
    assert "Near stern" not in text


def test_names_of_columns_have_their_units_in_both_files():
    flown = flight_rows(validation(cnr=[10.0, 20.0]))[0]
    named = measured_rows(tabulate_answers(answers(cnr=[10.0, 20.0])))[0]
    axes = {column(name) for name in ("range", *OF_FLIGHT)}
    assert axes < set(flown) and axes < set(named)
    for name in ("range_km", "depression_deg", "aircraft_speed_m_s", "ifov_urad", "line_rate_hz"):
        assert name in axes
    for name in ("cnr_db", "flown_pulse_width_ns", "jitter_time_s", "nedt_k", "transom_gain"):
        assert name in axes
    assert {"aspect_deg", "ship", "error_parameter", "error_value"} < set(flown)
    assert {"pulse_width_ns", "aspect_bin_deg", "error_parameter", "error_value"} < set(named)
    assert not {"range", "aspect", "aspect_bin", "cnr"} & (set(flown) | set(named))
    # What is left to the heading, or to the ship, is an empty field.
    assert flown["aircraft_track_deg"] is None and named["aircraft_track_deg"] is None
    assert flown["samples"] == named["samples"] == 160
