"""The infrared channel's tables as its users get them: on the screen, and in CSV files."""

import io
import math
import re

import numpy as np
import pytest
import xarray as xr
from made import formed, scores, with_units
from rich.console import Console
from stores import opened, printed, rows_of

from sweeps.report.score_figures import draw_table5
from sweeps.report.silhouettes import (
    detection_rows,
    print_detection,
    print_reconstruction,
    print_silhouette_accuracy,
    print_silhouette_categories,
    reconstruction_rows,
    sensor_rows,
    silhouette_accuracy_rows,
    silhouette_category_rows,
)

TITLES = [
    "Passive-infrared sensor",
    "Categories formed by the ACN from noiseless silhouettes",
    "Percent correct of silhouettes",
    "Ships detected",
    "Error of images",
]
CHOICES = {"coverage_rule", "segmentation", "inner_radius", "interpolation", "learning_rate"}
INTERVAL = {"percent_correct", "ci_low", "ci_high", "n"}
COLUMNS = {  # units in the names
    "infrared_sensor": {"range_km", "frame_count", "snr", "source_snr"}
    | {"attenuation_db", "source_attenuation_db", "contrast_k", "source_contrast_k"},
    "infrared_categories": CHOICES
    | {
        "vigilance",
        "trainings",
        "categories",
        "spread",
        "least",
        "most",
        "of_first_phase_and_order",
    }
    | {"training_silhouettes", "settled", "source_categories"},
    "infrared_accuracy": CHOICES
    | INTERVAL
    | {"vigilance", "silhouettes", "range_km", "super_resolution", "frame_count", "label_rule"}
    | {
        "score_rule",
        "learn_in_test",
        "frames_in_all",
        "aspect_bin_deg",
        "spread",
        "source_percent",
    },
    "infrared_detection": {"range_km", "coverage_rule", "frame_count", "aspect_bin_deg"}
    | {"probability", "lowest_of_views"},
    "infrared_super_resolution": {"range_km", "super_resolution", "coverage_rule", "frame_count"}
    | {"frames_in_all", "error", "spread"},
}
# Of the smoke experiment: 3 ranges, 2 numbers of frames, 3 resolutions, 3 bins and all.
COUNTS = dict(zip(COLUMNS, (3 * 2, 1, (1 + 3 * 2 * 3) * 4, 3 * 2 * 4, 3 * 3 * 2), strict=True))


def shown(write, *arguments):
    console = Console(file=io.StringIO(), width=200)
    write(*arguments, console)
    return console.file.getvalue()


def test_the_report_tells_of_the_sensor(smoke_store):
    text = " ".join(printed(smoke_store).split())
    assert all(title in text for title in TITLES)
    assert not re.search(r"\b(nan|inf|None)\b", text)


@pytest.mark.parametrize("name", COLUMNS)
def test_files_have_their_columns_and_a_row_a_cell(name, smoke_store):
    rows = rows_of(smoke_store, name)
    assert set(rows[0]) == COLUMNS[name]
    assert len(rows) == COUNTS[name]
    assert len({tuple(row.values()) for row in rows}) == COUNTS[name]


def test_figures_in_files_are_those_of_the_store(smoke_store):
    tables = opened(smoke_store, "tables/acn_infrared")
    for row in rows_of(smoke_store, "infrared_accuracy"):
        prefix = "training_" if row["silhouettes"] == "training" else ""
        place = {"vigilance": float(row["vigilance"]), "aspect_bin": row["aspect_bin_deg"]}
        if not prefix:
            place |= {"range": float(row["range_km"]), "frame_count": int(row["frame_count"])}
            place["super_resolution"] = row["super_resolution"]
            places = 4 if row["super_resolution"] == "shifted" else 1
            assert int(row["frames_in_all"]) == places * int(row["frame_count"])
        cell = tables.sel(place)
        for column, variable in (
            ("percent_correct", "accuracy"),
            ("ci_low", "ci_low"),
            ("ci_high", "ci_high"),
            ("spread", "spread"),
        ):
            stored = 100 * cell[prefix + variable].item()
            assert float(row[column]) == pytest.approx(stored, abs=0.0501)
        assert int(row["n"]) == cell[prefix + "n"].item()
    found = opened(smoke_store, "tables/detection")
    for row in rows_of(smoke_store, "infrared_detection"):
        place = {"range": float(row["range_km"]), "frame_count": int(row["frame_count"])}
        cell = found.sel(place | {"aspect_bin": row["aspect_bin_deg"]})
        assert float(row["probability"]) == pytest.approx(cell.probability.item(), rel=1e-6)
        assert float(row["lowest_of_views"]) == pytest.approx(cell.lowest.item(), rel=1e-6)
    restored = opened(smoke_store, "tables/super_resolution")
    for row in rows_of(smoke_store, "infrared_super_resolution"):
        place = {"range": float(row["range_km"]), "frame_count": int(row["frame_count"])}
        cell = restored.sel(place | {"super_resolution": row["super_resolution"]})
        assert float(row["error"]) == pytest.approx(cell.error.item(), abs=0.5001e-4)
        assert float(row["spread"]) == pytest.approx(cell.error_spread.item(), abs=0.5001e-4)


def test_the_sensors_file_is_table_1(smoke_store):
    """In closed form; the SNR is a power ratio, with noise that falls as the root of frames."""
    for row in rows_of(smoke_store, "infrared_sensor"):
        loss = 0.181 * float(row["range_km"])
        kelvin = 2.1585 * 10 ** (-loss / 20)
        noise = 0.4 / math.sqrt(int(row["frame_count"]))
        assert float(row["attenuation_db"]) == pytest.approx(loss, abs=0.5001e-3)
        assert float(row["contrast_k"]) == pytest.approx(kelvin, abs=0.5001e-4)
        assert float(row["snr"]) == pytest.approx((kelvin / noise) ** 2, abs=0.5001e-3)


def test_a_setting_of_the_sensor_may_be_an_axis():
    """The store's value counts, whatever the configuration says of it."""
    axes = {"range": [50.0], "frame_count": [16], "extinction": [0.1, 0.181], "nedt": 0.2}
    images = with_units(xr.Dataset(coords=axes))
    given = {"extinction": [0.1, 0.181], "contrast_at_zero": 2.1585, "nedt": 0.4}
    rows = sensor_rows(images, given)
    assert [row["extinction_db_per_km"] for row in rows] == [0.1, 0.181]
    for row in rows:
        loss = row["extinction_db_per_km"] * 50
        kelvin = 2.1585 * 10 ** (-loss / 20)
        assert row["attenuation_db"] == pytest.approx(loss, abs=1e-3)
        assert row["snr"] == pytest.approx((kelvin / 0.2) ** 2 * 16, rel=1e-4)


def silhouettes(super_resolution="shifted", **differs):
    axes = {"vigilance": [0.87], "range": [50.0], "super_resolution": [super_resolution]}
    axes |= {"frame_count": [16], "inner_radius": 0.5}
    tables = scores(prefixes=("", "training_"), spread=True, **axes).assign_coords(
        phase=[0, 1], order=[0, 1]
    )
    counts = np.array([[2, 3], [4, 3]])[..., None]
    return formed(tables, counts=counts, over=("phase", "order", "vigilance"), **differs)


def test_categories_are_those_of_the_trainings_there_are():
    (whole,) = silhouette_category_rows(silhouettes(views=6))
    assert (whole["trainings"], whole["training_silhouettes"]) == (4, 6)
    assert (whole["categories"], whole["least"], whole["most"]) == (3, 2, 4)
    assert whole["of_first_phase_and_order"] == 2 and whole["settled"] is True
    half = silhouettes(views=np.array([[0, 0], [6, 6]])[..., None])
    (row,) = silhouette_category_rows(half)
    assert (row["trainings"], row["categories"], row["least"], row["most"]) == (2, 3.5, 3, 4)
    assert row["of_first_phase_and_order"] is None
    (none,) = silhouette_category_rows(silhouettes(views=0))
    assert (none["trainings"], none["training_silhouettes"], none["settled"]) == (0, 0, False)
    assert {none[k] for k in ("categories", "least", "most", "of_first_phase_and_order")} == {None}
    assert "failed" in shown(print_silhouette_categories, [none])


@pytest.mark.parametrize("where", [{"aspect_bin": 1}, {}], ids=["a bin", "everything"])
def test_tables_and_pictures_show_dashes_for_what_is_not_there(where):
    tables = silhouettes()
    for name in ("accuracy", "training_accuracy", "spread", "training_spread"):
        tables[name][where] = np.nan
    rows = silhouette_accuracy_rows(tables)
    text = shown(print_silhouette_accuracy, rows)
    assert "nan" not in text.lower() and "inf" not in text.lower()
    unknown = sum(row["percent_correct"] is None for row in rows)
    assert unknown and text.count("–") >= unknown
    assert draw_table5(tables, ships=2).get_suptitle()


def test_shifted_images_are_said_to_take_four_times_the_frames():
    rows = silhouette_accuracy_rows(silhouettes())
    assert {(row["silhouettes"], row["frame_count"], row["frames_in_all"]) for row in rows} == {
        ("training", None, None),
        ("cut out", 16, 64),
    }
    assert "50 km, shifted, 4 x 16 " in shown(print_silhouette_accuracy, rows)
    assert "16 frames (4 × 16 where shifted)" in draw_table5(silhouettes(), ships=2).get_suptitle()
    plain = silhouettes("perfect")
    rows = silhouette_accuracy_rows(plain)
    assert {row["frames_in_all"] for row in rows} == {None, 16}
    assert "50 km, perfect " in shown(print_silhouette_accuracy, rows)
    assert "4 ×" not in draw_table5(plain, ships=2).get_suptitle()


@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_an_error_or_a_probability_without_end_is_no_figure(value):
    axes = {"range": [50.0], "super_resolution": ["shifted"], "frame_count": [16]}
    errors = {name: ([*axes], np.full((1, 1, 1), value)) for name in ("error", "error_spread")}
    rows = reconstruction_rows(with_units(xr.Dataset(errors, axes)))
    assert (rows[0]["error"], rows[0]["spread"], rows[0]["frames_in_all"]) == (None, None, 64)
    text = shown(print_reconstruction, rows)
    assert "–" in text and "nan" not in text and "shifted 2x, 4 x frames" in text
    axes = {"range": [50.0], "frame_count": [16], "aspect_bin": ["overall"]}
    found = {name: ([*axes], np.full((1, 1, 1), value)) for name in ("probability", "lowest")}
    rows = detection_rows(with_units(xr.Dataset(found, axes)))
    text = shown(lambda rows, console: print_detection(rows, 1e-6, console), rows)
    assert "–" in text and "nan" not in text
