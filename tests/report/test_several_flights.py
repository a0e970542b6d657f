"""Several flights in one store: each has its row, and titles tell which one is meant."""

import io
import re
import warnings
from itertools import takewhile

import numpy as np
import pytest
import xarray as xr
from made import scores, with_units
from rich.cells import cell_len
from rich.console import Console

from sweeps.report.axes import axes_of, nominal
from sweeps.report.flight_figures import draw_validation
from sweeps.report.flights import (
    LANDMARKS,
    flight_rows,
    measured_rows,
    print_flights,
    print_measured,
)
from sweeps.report.score_figures import draw_measured
from sweeps.report.sensitivity_figures import draw_sensitivity
from sweeps.report.tables import TITLES

DOWN_RANGE = np.arange(-60.0, 61.0)
SOURCES = ["measured", "noiseless", "synthetic", "point"]
KINDS = ["learned", "measured", "test"]
OF_FLIGHT = {  # one value each, unless a test says more
    **{"depression": 6.7, "aircraft_speed": 90.0, "aircraft_heading": 0.0, "samples": 160},
    **{"aircraft_track": np.nan, "pointing": np.nan, "ifov": 205.0, "line_rate": 119.0},
    **{"jitter_time": 0.1, "transom_gain": 1.0, "mast_gain": 1.0, "cnr": 20.0, "nedt": 0.4},
    **{"flown_pulse_width": 30.0, "autofocus": False, "mirror": "exact", "replicate": 0},
    **{"band_start": 8.0, "band_stop": 12.0, "clutter": 0.0, "clutter_length": 10.0},
    **{"mirror_angle": 45.0, "pulse_rate": 20_000.0, "range_filter": "cluster", "chain": "exact"},
}
OF_PROFILES = [
    *("profile_correlation", "profile_correlation_without_hangar", "mast_tilt", "waterline_tilt"),
    *("hangar_spike_offset", "closing_speed_error", "looks"),
    *(f"{one}_{what}_tilt" for one in ("intensity", "infrared") for what in ("mast", "waterline")),
]


def with_axes(axes):
    """Coordinates, and sizes of the dimensions among them."""
    axes = dict(axes)
    errors = axes.pop("errors", [("none", 0.0)])
    along = ("error",) if len(errors) > 1 else ()
    if along:
        axes["error"] = range(len(errors))
    coords = OF_FLIGHT | {name: (name, list(value)) for name, value in axes.items()}
    coords.setdefault("error", 0)
    for k, name in enumerate(("error_parameter", "error_value")):
        values = [error[k] for error in errors]
        coords[name] = (along, np.array(values, (object, float)[k])) if along else values[0]
    return coords, {name: len(value) for name, value in axes.items()}


def validation(seed=0, **axes):
    """A store's flights with made-up figures."""
    axes = {"ship": ["roberts", "duncan"], "aspect": [175.0], "range": [3.9]} | axes
    coords, sizes = with_axes(axes | {"source": SOURCES, "down_range": DOWN_RANGE})
    rng = np.random.default_rng(seed)
    data = {}
    for name in (*OF_PROFILES, *LANDMARKS, "profile"):
        gone = {"source", "down_range"} if name in OF_PROFILES else {"down_range"}
        dims = [dim for dim in sizes if name == "profile" or dim not in gone]
        data[name] = (dims, rng.uniform(0.1, 0.9, [sizes[dim] for dim in dims]))
    return with_units(xr.Dataset(data, coords))


def tables(seed=0, **axes):
    """A store's tables of measured profiles; those of synthetic ones the same of all flights."""
    leading = {"pulse_width": [10.0, 30.0], "classifier": ["acn", "correlation"]}
    leading |= {"vigilance": [0.95], "range": [3.0]}
    coords, sizes = with_axes(leading | axes | {"kind": KINDS})
    given = {name: coords[name][1] if name in sizes else coords[name] for name in coords}
    found = scores(seed, ("", "ship_"), ("10", "20", "overall"), **given)
    first = found.isel({name: 0 for name in ("cnr", "range") if name in sizes})
    same = xr.broadcast(first.drop_vars(("cnr", "range"), errors="ignore"), found)[0]
    return found.where(found.kind == "measured", same).assign_coords(found.coords)


def printed(write, what, width=100):
    console = Console(file=io.StringIO(), width=width)
    write(what, console)
    return console.file.getvalue()


def cells_of(line):
    """Cells of a printed line, between which are two blanks at least."""
    return re.split(r" {2,}", line.strip())


def rows_below(text, rule=0):
    """Lines of a printed table, from one of the rules below headings to the next blank line."""
    lines = text.splitlines()
    begin = [k for k, line in enumerate(lines) if line.startswith("───")][rule] + 1
    return [*takewhile(str.strip, lines[begin:])]


def test_every_flight_has_its_row_among_those_named():
    made = tables(cnr=[5.0, 20.0], range=[3.0, 4.0])
    rows = measured_rows(made)
    text = printed(print_measured, rows)
    found = [cells_of(line) for line in text.splitlines() if "  measured  " in line]
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
        here = made.sel(at).isel(vigilance=0)
        for label, shown in zip(made.aspect_bin.values, line[5:], strict=True):
            one = here.sel(aspect_bin=label)
            middle, low, high = (
                100 * float(one[name]) for name in ("ship_accuracy", "ship_ci_low", "ship_ci_high")
            )
            figures = [float(figure) for figure in re.findall(r"\d+", shown)]
            # A percent, of a tenth.
            assert figures == pytest.approx([middle, low, high], abs=0.56)
    # What is the same of all flights stands in one row.
    learned = [cells_of(line) for line in text.splitlines() if "  learned  " in line]
    assert [line[2:4] for line in learned] == [["all", "all"]] * 4


def test_vigilances_have_rows_where_they_matter():
    made = tables(vigilance=[0.9, 0.95])
    for name in ("ship_accuracy", "ship_ci_low", "ship_ci_high"):
        made[name][{"classifier": 1}] = made[name].isel(classifier=1, vigilance=0)
    text = printed(print_measured, measured_rows(made))
    lines = [cells_of(line) for line in text.splitlines() if "  measured  " in line]
    assert [line[2] for line in lines] == ["0.9", "0.95", "all"] * 2


def test_tilts_by_each_image_stand_beside_the_joint_ones():
    """Means over draws, a row a flight: mast by both, intensity and infrared, then waterline."""
    made = validation(replicate=[0, 1], clutter=[0.0, 0.3])
    text = printed(print_flights, made, width=160)
    rows = [*map(cells_of, rows_below(text[text.index("by each alone") :]))]
    expected = [(ship, level) for ship in made.ship.values for level in (0.0, 0.3)]
    assert [(row[0], float(row[1])) for row in rows[: len(expected)]] == expected
    names = [f"{by}{what}_tilt" for what in ("mast", "waterline")
             for by in ("", "intensity_", "infrared_")]  # fmt: skip
    for row, (ship, level) in zip(rows, expected, strict=False):
        one = made.sel(ship=ship, clutter=level)
        shown = [float(cell.split()[0]) for cell in row[2:]]
        assert shown == pytest.approx([float(one[name].mean()) for name in names], abs=0.0051)


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
    assert title.endswith("\nRoberts at 3.9 km, aspect 175°, simulated, cnr 10 dB, mirror exact")


def test_error_bars_of_sensitivities_are_explained_and_right():
    errors = [("none", 0.0), ("ship_heading", 5.0)]
    flights = validation(errors=errors, ship=["roberts"], replicate=[0, 1, 2])
    rng = np.random.default_rng(8)
    flights["profile_correlation"][:] = rng.uniform(0.8, 1, flights.profile_correlation.shape)
    figure = draw_sensitivity(flights)
    said = figure.legends[0].get_title().get_text()
    assert said == "mean ± standard deviation over 3 draws of the noise"
    bars = figure.axes[0].containers[0]
    here = nominal(flights.profile_correlation.to_dataset(), keep=("error", "replicate"))
    drawn = here.profile_correlation.transpose("error", "replicate").values
    np.testing.assert_allclose(bars.lines[0].get_ydata(), drawn.mean(axis=1))
    lengths = [np.ptp(segment[:, 1]) for segment in bars.lines[2][0].get_segments()]
    np.testing.assert_allclose(lengths, 2 * drawn.std(axis=1, ddof=1))


def test_a_flight_that_is_drawn_is_named():
    figure = draw_validation(validation(cnr=[10.0, 20.0], pointing=[np.nan, 4.0]))
    for axes in figure.axes:
        assert "cnr 10 dB" in axes.get_title() and "pointing –" in axes.get_title()
    figure = draw_validation(validation(replicate=[0, 1, 2]))
    assert "first of 3 draws" in figure.axes[0].get_title()
    made = tables(cnr=[5.0, 20.0], vigilance=[0.9, 0.95])
    title = "Ships identified by measured and by synthetic range profiles"
    assert draw_measured(made).get_suptitle() == f"{title}\nvigilance 0.9, cnr 5 dB"
    assert draw_measured(tables()).get_suptitle() == title


def test_panels_of_measured_profiles_have_the_titles_of_classifiers():
    made = tables()
    names = np.atleast_1d(made.classifier.values).tolist()
    panels = draw_measured(made).axes
    for axes, name in zip(panels, names * (len(panels) // len(names)), strict=True):
        # Scored by the ship alone.
        assert axes.get_title().startswith(TITLES.get(f"{name}_ship", TITLES[name]) + ", ")


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
    assert max(map(cell_len, text.splitlines())) <= width
    table = text[: text.index("Worst of")]
    words = [
        word for axis in axes_of(flights) if axis.name in MANY for word in axis.heading.split()
    ]
    words += ["correlation", "waterline", "hangar", "looks", "histogram", "of", "all"]
    for word in words:
        assert re.search(rf"\s{re.escape(word)},?\s", table), word
    if width == 300:
        assert len(rows_below(table)) == 2 ** len(MANY)  # a line each: no value is folded
    named = measured_rows(tables(cnr=MANY["cnr"], chain=["a_b", "c"]))
    text = printed(print_measured, named, width)
    assert "…" not in text and "a b" in " ".join(text.split()) and "[dB]" in text


def test_landmarks_of_a_ship_without_her_sister_stand_beside_herself_noiseless():
    flights = validation(ship=["connole", "roberts"], cnr=[10.0, 20.0])
    flights["mast_position"][{"ship": 0}] = np.nan
    text = printed(print_flights, flights)
    assert "Near stern: Roberts, simulated flight, 3.9 km, cnr 10 dB" in " ".join(text.split())
    one = flights.sel(ship="roberts").isel(aspect=0, range=0, cnr=0)
    for name, (words, digits, _) in LANDMARKS.items():
        figures = [
            f"{float(one[name].sel(source=k)):.{digits}f}" for k in ("noiseless", "measured")
        ]
        lines = [cells_of(line) for line in text.splitlines() if words in line]
        assert any(line[-len(figures) :] == figures for line in lines), name
    # Nothing is put in.
    assert "inputs, not results" not in text


def test_what_is_put_in_has_columns_of_its_own_beside_the_sister():
    flights = validation(transom_gain=[0.0, 1.0], mast_gain=[1.0, 3.0])
    text = printed(print_flights, flights, 200)
    assert "Duncan, synthetic, 3.9 km; Roberts, simulated flight, 3.9 km" in " ".join(text.split())
    near = flights.isel(aspect=0, range=0)
    duncan, roberts = (near.sel(ship=name) for name in ("duncan", "roberts"))
    plain = {"transom_gain": 1.0, "mast_gain": 1.0}
    ones = [
        *(duncan.sel(plain).sel(source=source) for source in ("point", "synthetic")),
        *(
            roberts.sel(plain | other).sel(source="measured")
            for other in ({}, {"transom_gain": 0.0}, {"mast_gain": 3.0})
        ),
    ]
    for name, (words, digits, _) in LANDMARKS.items():
        figures = [f"{float(one[name]):.{digits}f}" for one in ones]
        lines = [cells_of(line) for line in text.splitlines() if words in line]
        assert any(line[-len(figures) :] == figures for line in lines), name
    assert "masts*" in text and "inputs, not results" in text


def test_ships_of_another_class_have_no_landmarks():
    flights = validation(ship=["connole", "spruance"])
    flights["mast_position"][:] = np.nan
    text = printed(print_flights, flights)
    assert "Near stern" not in text


def test_names_of_columns_have_their_units_in_both_files():
    flown = flight_rows(validation(cnr=[10.0, 20.0]))[0]
    named = measured_rows(tables(cnr=[10.0, 20.0]))[0]
    axes = set(flown) & set(named)
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
