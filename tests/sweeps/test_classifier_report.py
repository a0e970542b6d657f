"""A tiny sweep of all classifiers of range profiles: what is reported of it."""

import math
import re

import pytest
from classifier_sweep import NAMES, OWN, SCALARS, group, rows_of
from sweeping import contents

from sweeps.report.classifiers import source_percent
from sweeps.report.command import main as report

COLUMNS = [
    "classifier",
    "range_km",
    "pulse_width_ns",
    "target_free_ifovs",
    *("vigilance", "learning_rate", "label_rule", "score_rule"),
    *("training", "gain_sigma", "left_out"),
    *("epochs", "grow_every", "mnn_learning_rate", "tolerance", "inputs", "annealing"),
    "frame_count",
    "aspect_bin_deg",
    "percent_correct",
    "ci_low",
    "ci_high",
    "n",
    "source_percent",
    "points_below_bound",
]
KEYS = COLUMNS[: COLUMNS.index("percent_correct")]


def test_the_file_has_its_columns_and_a_row_a_cell(swept):
    every = rows_of(swept)
    assert list(every[0]) == COLUMNS
    # Of what the two networks were trained with: 2 pulse widths, 4 bins.
    taught = [row for row in every if not row["frame_count"]]
    assert len(taught) == 2 * 4 * (2 + 4)
    rows = [row for row in every if row["frame_count"]]
    # 2 pulse widths, 2 numbers of frames, 4 bins; settings of each, the network scored twice.
    counts = {"acn": 2, "mnn": 4, "mnn_ship": 4, "correlation": 4, "likelihood": 4}
    assert len(rows) == 2 * 2 * 4 * sum(counts.values())
    for name, count in counts.items():
        assert sum(row["classifier"] == name for row in rows) == 2 * 2 * 4 * count
    assert len({tuple(row[key] for key in KEYS) for row in rows}) == len(rows)
    # What is no setting of a classifier is empty in its rows.
    for row in rows:
        name = row["classifier"].removesuffix("_ship")
        filled = {key for key in COLUMNS[4:17] if row[key] != ""}
        rules = {"label_rule", "score_rule"} if name == "acn" else set()
        assert filled == SCALARS[name] | set(OWN[name]) | rules


def test_figures_in_the_file_are_those_of_the_store(swept):
    tables = {name: group(swept, f"tables/{name}") for name in NAMES}
    for row in rows_of(swept):
        name = row["classifier"].removesuffix("_ship")
        prefix = "ship_" if row["classifier"].endswith("_ship") else ""
        place = {
            "range": float(row["range_km"]),
            "pulse_width": float(row["pulse_width_ns"]),
            "aspect_bin": row["aspect_bin_deg"],
        }
        if row["frame_count"]:
            place["frame_count"] = int(row["frame_count"])
        else:
            prefix = "training_"
        for key, values in OWN[name].items():
            (place[key],) = (value for value in values if str_of(value) == row[key])
        cell = tables[name].sel(place)
        for column, variable in (
            ("percent_correct", "accuracy"),
            ("ci_low", "ci_low"),
            ("ci_high", "ci_high"),
        ):
            stored = 100 * cell[prefix + variable].item()
            assert float(row[column]) == pytest.approx(stored, abs=0.0501)
        assert int(row["n"]) == cell[prefix + "n"].item()
        assert int(row["target_free_ifovs"]) == 4000


def str_of(value):
    return str(value if isinstance(value, str | bool) else float(value))


def test_points_below_the_bound(swept):
    """Those of the best known gain with all templates, less one's own, of the same test."""
    every = rows_of(swept)
    assert {row["points_below_bound"] for row in every if not row["frame_count"]} == {""}
    # Ship and aspect group is another question than the ship alone.
    assert {row["points_below_bound"] for row in every if row["classifier"] == "mnn"} == {""}
    rows = [row for row in every if row["frame_count"] and row["classifier"] != "mnn"]
    same = ("range_km", "pulse_width_ns", "target_free_ifovs", "frame_count", "aspect_bin_deg")
    allowed = [
        row for row in rows if row["classifier"] == "likelihood" and row["left_out"] == "False"
    ]
    below = []
    for row in rows:
        bounds = [
            float(other["percent_correct"])
            for other in allowed
            if all(other[key] == row[key] for key in same)
        ]
        assert len(bounds) == 2
        wanted = max(bounds) - float(row["percent_correct"])
        assert float(row["points_below_bound"]) == pytest.approx(wanted, abs=1e-9)
        below.append(wanted)
    assert min(below) <= 0 < max(below)


def test_the_sources_figures_stand_where_it_has_some(swept):
    """30 ns, 4 frames, by aspect group; of the ACN at its vigilance, of the network as scored."""
    tables = {
        "4": {"0": "48", "45": "25", "90": "23", "overall": ""},
        "": {"0": "100", "45": "93", "90": "43", "overall": ""},  # of what they were trained with
    }
    found = 0
    for row in rows_of(swept):
        asked = row["classifier"] == "mnn" or (
            row["classifier"] == "acn" and row["vigilance"] == "0.95"
        )
        table = tables.get(row["frame_count"])
        there = asked and row["pulse_width_ns"] == "30.0" and table is not None
        wanted = table[row["aspect_bin_deg"]] if there else ""
        assert row["source_percent"] == wanted
        found += wanted != ""
    assert found == 2 * 3 * (1 + 4)


@pytest.mark.parametrize(
    ("change", "lowest", "receiver", "figure"),
    [
        ({}, 0, "full_profile", 63),
        ({}, 57, "full_profile", 20),
        ({}, 60, "full_profile", 25),
        ({}, 90, "full_profile", 25),
        ({}, 93, "full_profile", None),
        ({}, math.nan, "full_profile", None),
        ({}, 0, "peak_pulse", None),
        ({"range_km": 50}, 0, "full_profile", None),
        ({"pulse_width_ns": 10}, 0, "full_profile", None),
        ({"frame_count": 7}, 0, "full_profile", None),
    ],
)
def test_whose_figure_the_source_has(change, lowest, receiver, figure):
    axes = {"range_km": 100, "pulse_width_ns": 30, "frame_count": 8} | change
    assert source_percent("mnn", axes, lowest, receiver) == figure
    assert source_percent("acn", axes | {"vigilance": 0.95}, lowest, receiver) == figure
    for name, vigilance in (("acn", 0.9), ("correlation", None), ("likelihood", None)):
        assert source_percent(name, axes | {"vigilance": vigilance}, lowest, receiver) is None


def test_the_report_prints_all_side_by_side(swept, monkeypatch, capsys):
    before = contents(swept / "s-tables")
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr("sys.argv", ["ncti-report", str(swept / "s.zarr")])
    report()
    printed = capsys.readouterr().out
    assert contents(swept / "s-tables") == before
    assert not re.search(r"\b(nan|None|inf)\b", printed)
    for pulse_width in (30, 50):
        title = f"by classifier (100 km, 4000 target-free IFOVs, {pulse_width} ns)"
        assert title in printed
    for line in (
        "MNN, ship and aspect group, raw inputs, annealed",
        "MNN, ship alone, standardised inputs, not annealed",
        "correlation, learned from noisy profiles, true aspect left out",
        "maximum likelihood, gain known",
        "maximum likelihood, gain unknown by 100%, true aspect left out",
    ):
        # Pulse widths, numbers of frames; of a network's own answers also to its training.
        trained = "aspect group" in line
        assert printed.count(f"{line} ") == 2 * (2 + trained)
