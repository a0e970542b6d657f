"""What the report and the pictures say of flights is what the store holds."""

import numpy as np
import pytest
from stores import attributes_of, opened, printed, rows_of

from ncti.irar import Window, correct, segmented
from sweeps.report import figures
from sweeps.report.flight_figures import flights_of, known_ship, one_flight, scan_of
from sweeps.report.flights import LANDMARKS, flight_rows

FLIGHTS = "validation"


def test_rows_are_means_and_scatter_of_draws(sisters):
    flights = opened(sisters, FLIGHTS)
    rows = flight_rows(flights)
    figures = [
        name for name, values in flights.items() if not set(values.dims) & {"row", "down_range"}
    ]
    flown = flights.sizes["ship"] * flights.sizes["transom_gain"]
    by_source = sum("source" in flights[name].dims for name in figures)
    assert len(rows) == flown * (len(figures) + 3 * by_source)
    for row in rows[:: len(rows) // 50]:
        here = flights[row["figure"]].sel(ship=row["ship"], transom_gain=row["transom_gain"])
        here = here.isel(aspect=0, range=0)
        draws = (here.sel(source=row["source"]) if row["source"] else here).values
        if np.isnan(draws).all():
            assert row["value"] is None
            continue
        assert row["value"] == pytest.approx(np.nanmean(draws), rel=2e-7, abs=6e-6)
        assert row["standard_deviation"] == pytest.approx(np.std(draws, ddof=1), rel=2e-7, abs=6e-6)
        assert row["draws"] == 2
        assert row["units"] == flights[row["figure"]].units


def test_landmarks_stand_beside_the_source_s_words(sisters):
    text = printed(sisters)
    assert "Near stern: Duncan, synthetic, 3 km; Roberts, simulated flight, 3 km" in text
    for heading, _, _ in LANDMARKS.values():
        assert heading.strip() in text
    flights = opened(sisters, FLIGHTS).isel(aspect=0, range=0).sel(transom_gain=1)
    expected = float(flights.stern_to_hangar.sel(ship="duncan", source="point").mean())
    (line,) = [line for line in text.splitlines() if "stern to hangar" in line]
    assert f"{expected:.1f}" in line
    assert "inputs, not results" in text


def test_csv_files_hold_the_rows(sisters):
    printed(sisters)
    rows = rows_of(sisters, "flights")
    assert len(rows) == len(flight_rows(opened(sisters, FLIGHTS)))
    named = rows_of(sisters, "measured")
    table = opened(sisters, "tables/measured")
    assert len(named) == table.accuracy.size
    whole = [
        row
        for row in named
        if (row["classifier"], row["kind"], row["aspect_bin_deg"]) == ("acn", "measured", "overall")
        and row["pulse_width_ns"] == "30.0"
    ]
    shares = table.ship_accuracy.sel(classifier="acn", kind="measured", aspect_bin="overall")
    shares = 100 * shares.sel(pulse_width=30.0).values.ravel()
    assert sorted(float(row["ship_percent_correct"]) for row in whole) == pytest.approx(
        sorted(shares.tolist()), abs=0.051
    )


def test_a_flight_drawn_is_the_flight_stored(sisters):
    """Flown again from the store's configuration: the very image."""
    given, flights = attributes_of(sisters), opened(sisters, FLIGHTS)
    place = next(one for one in flights_of(flights) if one.ship == "roberts")
    stored = one_flight(flights, place)
    assert (stored.transom_gain, stored.mast_gain, stored.replicate) == (1, 1, 0)
    scan, _ = scan_of(given, stored, known_ship(given, place.ship))
    assert place.title == "Roberts at 3 km, aspect 175°, simulated"
    row, column = stored.row.values, stored.column.values
    window = Window(int(row[0]), int(column[0]), len(row), len(column))
    image = segmented(correct(scan, window=window), scan.flight)
    there = np.isfinite(stored.intensity.values) & (image.looks > 0)
    assert there.sum() > 100
    # Rows at the rim of the stored window may gather other looks.
    same = np.isclose(stored.intensity.values, image.intensity, rtol=1e-5)
    assert same[there].mean() == 1


def test_wrong_parameters_are_listed_with_what_autofocus_gives_back(misled):
    text = printed(misled)
    assert "Simulated flights, wrong parameters: roberts" in text
    flights = opened(misled, FLIGHTS).isel(ship=0, aspect=0, range=0)
    for k in range(1, flights.sizes["error"]):
        one = flights.isel(error=k)
        name = str(one.error_parameter.item()).replace("_", " ")
        found = [f"{float(one.profile_correlation.sel(autofocus=on)):.3f}" for on in (False, True)]
        lines = [line for line in text.splitlines() if name in line]
        assert any(all(figure in line for figure in found) for line in lines)


@pytest.mark.parametrize("kind", ["flight", "validation", "measured"])
def test_pictures_of_flights_are_drawn(kind, sisters, tmp_path):
    figure = figures.draw(kind, sisters)
    figure.savefig(tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 10_000


def test_profiles_drawn_are_those_stored(sisters):
    figure = figures.draw("validation", sisters)
    flights = opened(sisters, FLIGHTS).isel(aspect=0, range=0, replicate=0).sel(transom_gain=1)
    profile = flights.profile.sel(ship="roberts", source="measured").values
    line = figure.axes[0].lines[0]
    np.testing.assert_allclose(line.get_ydata(), profile / profile.max(), rtol=1e-6)


def test_curves_of_errors_pass_through_what_is_stored(misled):
    figure = figures.draw("sensitivity", misled)
    assert [axes.get_xlabel() for axes in figure.axes] == [
        "error of aircraft speed [%]",
        "error of ship heading [°]",
    ]
    flights = opened(misled, FLIGHTS).isel(ship=0, aspect=0, range=0).sel(autofocus=False)
    x, y = figure.axes[0].containers[0].lines[0].get_data()
    assert list(x) == [-2, 0, 2]
    expected = flights.profile_correlation.sortby(flights.error_value)
    expected = expected[flights.sortby("error_value").error_parameter != "ship_heading"]
    np.testing.assert_allclose(y, expected, rtol=1e-6)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["parameters as recorded", "with autofocus"]
    assert figure.legends[0].get_title().get_text() == ""  # of one draw there are no error bars


def test_no_errors_no_curves(sisters):
    with pytest.raises(ValueError, match="errors is empty"):
        figures.draw("sensitivity", sisters)


def test_the_worst_draw_is_told(sisters):
    """Of every flight and draw, by numpy from the store."""
    flights = opened(sisters, FLIGHTS)
    lean = [np.nanmax(np.abs(flights[f"{name}_tilt"])) for name in ("mast", "waterline")]
    like = np.nanmin(flights.profile_correlation)
    beside = np.nanmin(flights.profile_correlation_without_hangar)
    text = " ".join(printed(sisters).split())
    assert (
        f"Worst of {flights.looks.size} flights, each draw separately: correlation {like:.3f}, "
        f"without the hangar {beside:.3f}; mast {lean[0]:.2f} deg, waterline {lean[1]:.2f} deg."
    ) in text
