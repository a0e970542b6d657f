"""The infrared channel's tables as its users get them: on the screen, and in CSV files."""

import csv
import math
import re
import shutil

import pytest
import xarray as xr
from sweeping import TINY, contents

from sweeps.app import main
from sweeps.report.command import main as report

# What the sensors leave in a folder of tables.
RANGE_FILES = {"categories.csv", "accuracy.csv"}
INFRARED_FILES = {
    f"infrared_{name}.csv"
    for name in ("sensor", "categories", "accuracy", "detection", "super_resolution")
}
FILES = {
    "range": RANGE_FILES,
    "infrared": INFRARED_FILES,
    "both": RANGE_FILES | INFRARED_FILES,
}
TITLES = {
    "range": ["Categories formed by the ACN (100 km", "Percent correct, ACN (100 km"],
    "infrared": [
        "Passive-infrared sensor",
        "Categories formed by the ACN from noiseless silhouettes",
        "Percent correct of silhouettes",
        "Ships detected",
        "Error of images",
    ],
}
TITLES["both"] = TITLES["range"] + TITLES["infrared"]

CHOICES = ["coverage_rule", "segmentation", "inner_radius", "interpolation", "learning_rate"]
COLUMNS = {  # units in the names
    "infrared_sensor": [
        "range_km",
        "frame_count",
        "attenuation_db",
        "source_attenuation_db",
        "contrast_k",
        "source_contrast_k",
        "snr",
        "source_snr",
    ],
    "infrared_categories": [
        *CHOICES,
        "vigilance",
        "trainings",
        "categories",
        "least",
        "most",
        "of_first_phase_and_order",
        "training_silhouettes",
        "settled",
        "source_categories",
    ],
    "infrared_accuracy": [
        *CHOICES,
        "vigilance",
        "silhouettes",
        "range_km",
        "super_resolution",
        "frame_count",
        "label_rule",
        "score_rule",
        "frames_in_all",
        "aspect_bin_deg",
        "percent_correct",
        "ci_low",
        "ci_high",
        "spread",
        "n",
        "source_percent",
    ],
    "infrared_detection": [
        "range_km",
        "coverage_rule",
        "frame_count",
        "aspect_bin_deg",
        "probability",
        "lowest_of_views",
    ],
    "infrared_super_resolution": [
        "range_km",
        "super_resolution",
        "coverage_rule",
        "frame_count",
        "frames_in_all",
        "error",
        "spread",
    ],
}
# Of the tiny sweep: 2 ranges, 2 numbers of frames, 3 resolutions, 2 radii, 2 vigilances, 4 bins.
KEYS = {
    "infrared_sensor": (2 * 2, ["range_km", "frame_count"]),
    "infrared_categories": (2 * 2, ["inner_radius", "vigilance"]),
    "infrared_accuracy": (
        (1 + 2 * 2 * 3) * 2 * 2 * 4,
        [
            *("range_km", "super_resolution", "frame_count"),
            *("inner_radius", "vigilance", "aspect_bin_deg"),
        ],
    ),
    "infrared_detection": (2 * 2 * 4, ["range_km", "frame_count", "aspect_bin_deg"]),
    "infrared_super_resolution": (2 * 3 * 2, ["range_km", "super_resolution", "frame_count"]),
}


def run(monkeypatch, folder, *given, code=0):
    """The tiny sweep in this process, with other values of what is given."""
    keys = tuple(item.partition("=")[0] + "=" for item in given)
    tiny = [item for item in TINY if not item.startswith(keys)]
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.argv", ["ncti-sweep", *tiny, *given, "cluster=inline"])
    with pytest.raises(SystemExit) as exit_:
        main()
    assert exit_.value.code == code


@pytest.fixture(scope="module")
def stores(tmp_path_factory, cache):
    """Tiny stores of either sensor and of both, made in this process."""
    folder = tmp_path_factory.mktemp("tiny")
    (folder / "cache").mkdir()
    (cache / "meshes").mkdir(parents=True, exist_ok=True)
    (folder / "cache" / "meshes").symlink_to(cache / "meshes", target_is_directory=True)
    for sensor in FILES:
        with pytest.MonkeyPatch.context() as patch:
            run(patch, folder, f"sensor={sensor}", f"store={sensor}.zarr", "cache=cache")
    return folder


def table(folder, name):
    with (folder / f"{name}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("sensor", FILES)
def test_the_report_tells_of_the_sensors_that_looked(sensor, stores, tmp_path, monkeypatch, capsys):
    made = contents(stores / f"{sensor}-tables")
    assert set(made) == FILES[sensor]
    shutil.copytree(stores / f"{sensor}.zarr", tmp_path / f"{sensor}.zarr")
    monkeypatch.setattr("sys.argv", ["ncti-report", str(tmp_path / f"{sensor}.zarr")])
    report()
    printed = " ".join(capsys.readouterr().out.split())
    for title in TITLES["both"]:
        assert (title in printed) == (title in TITLES[sensor])
    assert "nan" not in printed
    assert contents(tmp_path / f"{sensor}-tables") == made


def test_tables_of_a_sensor_do_not_depend_on_the_other(stores):
    both = contents(stores / "both-tables")
    for sensor in ("range", "infrared"):
        for name, content in contents(stores / f"{sensor}-tables").items():
            assert both[name] == content


@pytest.mark.parametrize("name", COLUMNS)
def test_files_have_their_columns_and_a_row_a_cell(name, stores):
    rows = table(stores / "infrared-tables", name)
    assert list(rows[0]) == COLUMNS[name]
    count, keys = KEYS[name]
    assert len(rows) == count
    assert len({tuple(row[key] for key in keys) for row in rows}) == count


def test_figures_in_files_are_those_of_the_store(stores):
    tables = xr.open_zarr(stores / "infrared.zarr", group="tables/acn_infrared").load()
    for row in table(stores / "infrared-tables", "infrared_accuracy"):
        prefix = "training_" if row["silhouettes"] == "training" else ""
        place = {"inner_radius": float(row["inner_radius"]), "aspect_bin": row["aspect_bin_deg"]}
        place["vigilance"] = float(row["vigilance"])
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
        assert int(row["n"]) == (6 if row["aspect_bin_deg"] == "overall" else 2)
    found = xr.open_zarr(stores / "infrared.zarr", group="tables/detection").load()
    for row in table(stores / "infrared-tables", "infrared_detection"):
        cell = found.sel(
            range=float(row["range_km"]),
            frame_count=int(row["frame_count"]),
            aspect_bin=row["aspect_bin_deg"],
        )
        assert float(row["probability"]) == pytest.approx(cell.probability.item(), rel=1e-6)
        assert float(row["lowest_of_views"]) == pytest.approx(cell.lowest.item(), rel=1e-6)
    restored = xr.open_zarr(stores / "infrared.zarr", group="tables/super_resolution").load()
    for row in table(stores / "infrared-tables", "infrared_super_resolution"):
        cell = restored.sel(
            range=float(row["range_km"]),
            frame_count=int(row["frame_count"]),
            super_resolution=row["super_resolution"],
        )
        assert float(row["error"]) == pytest.approx(cell.error.item(), abs=0.5001e-4)
        assert float(row["spread"]) == pytest.approx(cell.error_spread.item(), abs=0.5001e-4)


def test_the_sensors_file_is_table_1(stores):
    """In closed form; the SNR is a power ratio, with noise that falls as the root of frames."""
    for row in table(stores / "infrared-tables", "infrared_sensor"):
        loss = 0.181 * float(row["range_km"])
        kelvin = 2.1585 * 10 ** (-loss / 20)
        noise = 0.4 / math.sqrt(int(row["frame_count"]))
        assert float(row["attenuation_db"]) == pytest.approx(loss, abs=0.5001e-3)
        assert float(row["contrast_k"]) == pytest.approx(kelvin, abs=0.5001e-4)
        assert float(row["snr"]) == pytest.approx((kelvin / noise) ** 2, abs=0.5001e-3)


def test_a_training_range_at_which_ships_fill_no_pixel(stores, tmp_path, monkeypatch, capsys):
    """Nothing to learn from: every training is named, and the tables say that it failed."""
    given = ("sensor=infrared", "infrared.training_range=1000", "infrared.inner_radius=0.5")
    cached = f"cache={stores / 'cache'}"
    run(monkeypatch, tmp_path, *given, "store=s.zarr", cached, code=1)
    told = capsys.readouterr()
    last = told.err.strip().splitlines()[-1]
    assert last.startswith("ncti-sweep: 2 tasks failed: classification of acn_infrared phase=0 (")
    assert "Traceback" not in told.err
    assert "nan" not in told.out
    assert {
        (row["trainings"], row["categories"], row["training_silhouettes"])
        for row in table(tmp_path / "s-tables", "infrared_categories")
    } == {("0", "", "0")}
    accuracy = table(tmp_path / "s-tables", "infrared_accuracy")
    assert {(row["percent_correct"], row["spread"], row["n"]) for row in accuracy} == {
        ("", "", "0")
    }
    # What does not need the classifier is there.
    found = table(tmp_path / "s-tables", "infrared_detection")
    assert all(0 < float(row["probability"]) <= 1 for row in found)


def test_no_contrast_left_by_the_air(stores, tmp_path, monkeypatch, capsys):
    given = ("sensor=infrared", "infrared.extinction=10", "infrared.range=[25,100]")
    run(monkeypatch, tmp_path, *given, "store=s.zarr", f"cache={stores / 'cache'}")
    told = capsys.readouterr().out
    assert not re.search(r"\b(nan|inf)\b", told)
    rows = table(tmp_path / "s-tables", "infrared_super_resolution")
    assert {(row["error"], row["spread"]) for row in rows} == {("", "")}
