"""A tiny sweep of all classifiers of range profiles: what is reported of it."""

import io
import math
import re

import pytest
import xarray as xr
from rich.console import Console
from stores import contents, opened, printed, rows_of

from sweeps.report.places import tables_folder
from sweeps.report.rows import source_percent
from sweeps.report.tables import classifier_rows, print_classifiers

NAMES = ("acn", "mnn", "correlation", "likelihood")
OWN = {  # axes that each of them has several values on
    "acn": {"vigilance": [0.9, 0.95]},
    "mnn": {"inputs": ["raw", "standardised"], "annealing": [True, False]},
    "correlation": {"training": ["expected", "noisy"], "left_out": [False, True]},
    "likelihood": {"gain_sigma": [0, 1], "left_out": [False, True]},
}
SCALARS = {  # and axes of one value
    "acn": {"learning_rate", "label_rule", "score_rule", "learn_in_test"},
    "mnn": {"epochs", "grow_every", "mnn_learning_rate", "tolerance"},
    "correlation": set(),
    "likelihood": set(),
}

COLUMNS = [
    "classifier",
    "range_km",
    "pulse_width_ns",
    *("target_free_ifovs", "receiver"),
    *("learning_rate", "vigilance", "label_rule", "score_rule"),
    *("training", "gain_sigma", "learn_in_test", "left_out"),
    *("epochs", "grow_every", "mnn_learning_rate", "tolerance", "inputs", "annealing"),
    "frame_count",
    "aspect_bin_deg",
    "percent_correct",
    "ci_low",
    "ci_high",
    "spread",
    "n",
    "source_percent",
    "bound_gain_sigma",
    "points_below_bound",
]
KEYS = COLUMNS[: COLUMNS.index("percent_correct")]


def test_the_file_has_its_columns_and_a_row_a_cell(classified):
    every = rows_of(classified, "classifiers")
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
        filled = {key for key in COLUMNS[5:19] if row[key] != ""}
        assert filled == SCALARS[name] | set(OWN[name])


def test_figures_in_the_file_are_those_of_the_store(classified):
    tables = {name: opened(classified, f"tables/{name}") for name in NAMES}
    for row in rows_of(classified, "classifiers"):
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


def test_points_below_the_bound(classified):
    """Those of the gain that is known least, less one's own, of the same test and templates."""
    every = rows_of(classified, "classifiers")
    assert {row["points_below_bound"] for row in every if not row["frame_count"]} == {""}
    # Ship and aspect group is another question than the ship alone.
    assert {row["points_below_bound"] for row in every if row["classifier"] == "mnn"} == {""}
    rows = [row for row in every if row["frame_count"] and row["classifier"] != "mnn"]
    same = ("range_km", "pulse_width_ns", "target_free_ifovs", "frame_count", "aspect_bin_deg")
    below = {}
    for row in rows:
        (bound,) = (
            float(other["percent_correct"])
            for other in rows
            if other["classifier"] == "likelihood"
            and other["gain_sigma"] == "1.0"
            and other["left_out"] == (row["left_out"] or "False")
            and all(other[key] == row[key] for key in same)
        )
        wanted = bound - float(row["percent_correct"])
        assert float(row["points_below_bound"]) == pytest.approx(wanted, abs=1e-9)
        assert row["bound_gain_sigma"] == "1.0"
        below.setdefault((row["classifier"], row["gain_sigma"], row["left_out"]), []).append(wanted)
    assert not any(below["likelihood", "1.0", "False"] + below["likelihood", "1.0", "True"])
    assert any(below["likelihood", "0.0", "False"]) and any(below["mnn_ship", "", ""])


def test_the_bound_does_not_hang_on_what_else_is_swept(classified):
    """Neither on a gain that is known better, nor on the order of gains; one gain names itself."""
    tables = {name: opened(classified, f"tables/{name}") for name in NAMES}
    rows = classifier_rows(tables)
    for gains in ([1], [1, 0]):
        fewer = tables | {"likelihood": tables["likelihood"].sel(gain_sigma=gains)}
        others = [row for row in classifier_rows(fewer) if row["classifier"] != "likelihood"]
        assert others == [row for row in rows if row["classifier"] != "likelihood"]
    known = tables | {"likelihood": tables["likelihood"].sel(gain_sigma=0)}
    assert {row["bound_gain_sigma"] for row in classifier_rows(known)} == {None, 0}
    # What leaves no aspect out has no bound where likelihood leaves all of them out.
    left_out = tables | {"likelihood": tables["likelihood"].sel(left_out=True)}
    for row in classifier_rows(left_out):
        bounded = bool(row["left_out"]) and row["frame_count"] is not None
        assert (row["points_below_bound"] is not None) == bounded


def test_rules_for_what_is_right(classified):
    """Only ships have a bound; what no rule scores has none in its name."""
    tables = {name: opened(classified, f"tables/{name}") for name in NAMES}
    scored = tables["acn"].drop_vars("score_rule")
    trained = [name for name in scored if str(name).startswith(("training_", "category", "view_"))]
    both = xr.concat([scored.drop_vars([*trained, "settled"])] * 2, "score_rule")
    both = both.assign_coords(score_rule=["ship", "category"])
    rules = both.merge(scored[[*trained, "settled"]]).assign_attrs(tables["acn"].attrs)
    rows = classifier_rows(tables | {"acn": rules})
    of_acn = [row for row in rows if row["classifier"] == "acn"]
    for rule, bounded in (("ship", True), ("category", False), (None, False)):
        found = {row["points_below_bound"] is None for row in of_acn if row["score_rule"] == rule}
        assert found == {not bounded}
    screen = io.StringIO()
    print_classifiers(rows, Console(file=screen, width=200))
    text = screen.getvalue()
    assert "ACN, right by ship" in text and "ACN, right by category" in text
    assert not re.search(r"\b(nan|None|inf)\b", text)
    assert "gain unknown by 100%, overall" in " ".join(text.split())


def test_the_source_has_no_figures_beside_other_ships(classified):
    assert {row["source_percent"] for row in rows_of(classified, "classifiers")} == {""}
    assert {row["source_categories"] for row in rows_of(classified, "categories")} == {""}


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
    axes |= {"receiver": receiver}
    assert source_percent("mnn", axes, lowest) == figure
    assert source_percent("acn", axes | {"vigilance": 0.95}, lowest) == figure
    for name, vigilance in (("acn", 0.9), ("correlation", None), ("likelihood", None)):
        assert source_percent(name, axes | {"vigilance": vigilance}, lowest) is None


def test_the_report_prints_all_side_by_side(classified):
    before = contents(tables_folder(classified))
    text = printed(classified, 300)
    assert contents(tables_folder(classified)) == before
    assert not re.search(r"\b(nan|None|inf)\b", text)
    for pulse_width in (30, 50):
        title = f"by classifier (100 km, 4000 target-free IFOVs, {pulse_width} ns)"
        assert title in text
    for line in (
        "MNN, ship + aspects, raw inputs, annealed",
        "MNN, ship alone, standardised inputs, not annealed",
        "correlation, learned from noisy profiles, true aspect left out",
        "maximum likelihood, gain known",
        "maximum likelihood, gain unknown by 100%, true aspect left out",
    ):
        # Pulse widths, numbers of frames; of a network's own answers also to its training.
        trained = "aspects" in line
        below = line.startswith(("MNN, ship alone", "correlation"))  # the bound
        assert text.count(f"{line} ") == 2 * (2 + trained + below)
