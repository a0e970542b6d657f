"""The first sentence of a report names the best classifier, its scores, intervals and chance."""

import re

import numpy as np
import pytest
import xarray as xr
from made import SHIPS, displayed, scores
from pages import stored

from sweeps.engine.declare.display import ATTRIBUTE, Display, Figure
from sweeps.engine.declare.storable import encode_attrs
from sweeps.report.frames import read_frames
from sweeps.report.headline import headline
from sweeps.report.ranking import main_axis, main_frame

GIVEN = {"grid": {"ship": list(SHIPS)}}


def sentence(tmp_path, attributes, **tables):
    path = stored(tmp_path / "s.zarr", attributes, **tables)
    return headline(read_frames(path), attributes)[0]


def shares(*values, **axes):
    """Return scores of given shares along an axis, with intervals of a tenth to either side."""
    table = scores(**axes)
    along = xr.DataArray(list(values), dims=next(n for n, v in axes.items() if isinstance(v, list)))
    for name, beyond in (("accuracy", 0), ("ci_low", -0.1), ("ci_high", 0.1)):
        table[name] = (along + beyond).broadcast_like(table.accuracy)
    return table


def test_headline_gives_both_ends_of_the_swept_axis(tmp_path):
    table = scores(cnr=[23.0, 26.0, 32.0], frame_count=[4, 16], range=100.0)
    attrs = {"configuration": GIVEN, "swept": ["cnr"]}
    text = sentence(tmp_path, attrs, tables__acn=displayed(table))
    overall = table.sel(aspect_bin="overall", frame_count=16)
    for cnr, place in ((23.0, "of four ships at CNR 23 dB"), (32.0, "at 32 dB")):
        point = overall.sel(cnr=cnr)
        ends = (float(point.accuracy), float(point.ci_low), float(point.ci_high))
        share, low, high = (f"{round(100 * end, 1):.0f}" for end in ends)
        assert f"{share} % [{low}–{high}] {place}" in text
    assert text.startswith("ACN on range profiles identifies")
    assert "(range 100 km, frame count 16)" in text and text.endswith("chance 25 %.")


ONE, NONE = "1 of 2 values of CNR, the one that all have.", "none is shared."


@pytest.mark.parametrize(
    ("correlation", "acn", "best", "ranked"),
    [
        ((0.5, 0.95), (0.6, 0.8), "correlation", ""),
        ((0.9, 0.4), (0.6, 0.8), "ACN", ""),
        ((0.8, 0.6), (0.6, 0.8), "correlation", ""),
        ((0.5, 0.9), (np.nan, 0.8), "correlation", ONE),
        ((0.5, 0.7), (np.nan, 0.8), "ACN", ONE),
        ((0.5, np.nan), (np.nan, 0.8), "ACN", f"means over different values of CNR, since {NONE}"),
    ],
    ids=["mean", "one end", "equal", "failed where all are poor", "failed", "none in common"],
)
def test_the_best_has_the_highest_mean_over_shared_values(correlation, acn, best, ranked, tmp_path):
    """Of equals the simplest is best; a classifier gains nothing by failing where all are poor."""
    tables = {
        "tables__correlation": displayed(shares(*correlation, cnr=[23.0, 32.0]), "correlation"),
        "tables__acn": displayed(shares(*acn, cnr=[23.0, 32.0])),
    }
    text = sentence(tmp_path, {"swept": ["cnr"]}, **tables)
    assert text.startswith(f"Best of 2: {best} on range profiles identifies")
    assert ("Ranked by " in text) == bool(ranked) and ranked in text


def test_score_whose_interval_contains_chance_is_not_significant(tmp_path):
    table = displayed(shares(0.3, 0.6, cnr=[23.0, 32.0]))
    text = sentence(tmp_path, {"swept": ["cnr"]}, tables__acn=table)
    first = "30 % [20–40] of ships at CNR 23 dB, not significantly better than chance"
    assert f"{first}, and 60 % [50–70]" in text
    assert text.count("not significantly better than chance") == 1


def test_headline_omits_axes_that_the_best_classifier_lacks(tmp_path):
    best = shares(0.9, frame_count=[16])
    other = shares(0.4, 0.6, votes=[1, 5])
    tables = {"tables__likelihood": displayed(best, "likelihood"), "tables__acn": displayed(other)}
    text = sentence(tmp_path, {"swept": ["votes"]}, **tables)
    assert "maximum likelihood" in text and "votes" not in text and "–;" not in text


def test_headline_warns_of_few_answers_and_excludes_unknown_ships(tmp_path):
    few = shares(0.9, frame_count=[16])
    few.n[:] = 8
    attrs = {
        "configuration": {
            "grid": {"ship": ["duncan", "texas"]},
            "classifier": {"unknown": ["texas"]},
        }
    }
    text = sentence(tmp_path, attrs, tables__acn=displayed(few))
    assert "of one ship" in text and re.search(r"Few answers \(n = 8\)", text)


def test_headline_names_the_best_row_of_other_percentages(tmp_path):
    share = xr.DataArray([[0.2, 0.6], [0.9, 0.1], [0.3, 0.5]], dims=("tree", "split"))
    table = xr.Dataset(
        {"share": share}, {"tree": ["ash", "elm", "oak"], "split": ["a-gap", "aspect-random"]}
    )
    figure = Figure("share", "percent_correct", percent=True, format=".0f")
    display = Display("trees", "Trees", (figure,), rows=("tree",), columns="split", chance=25.0)
    table = table.assign_attrs(encode_attrs({ATTRIBUTE: [display.as_attribute(None)]}))
    text = sentence(tmp_path, {"swept": []}, tables__trees=table)
    assert text == "Percent correct is 60 %, tree ash, split aspect-random; chance 25 %."


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([0.6671, 0.5, 0.4108], "Cumulant falls from 0.67 at 1.5 to 0.41 at 3.0 J/k, size 8."),
        (
            [0.3, 0.9, 0.4],
            "Cumulant rises from 0.30 at 1.5 to 0.40 at 3.0 J/k, with a maximum of 0.90 at 2",
        ),
        ([0.991, 0.992, 0.994], "Cumulant rises from 0.991 at 1.5 to 0.994 at 3.0 J/k"),
        ([5.0, 5.0, 5.0], "Cumulant is 5 at 1.5 and at 3.0 J/k, size 8."),
        ([0.5, np.inf, 0.4], "Cumulant falls from 0.50 at 1.5 to 0.40 at 3.0 J/k, size 8."),
    ],
)
def test_headline_describes_any_experiment(values, said, tmp_path):
    figures = xr.DataArray([values, np.zeros(3)], dims=("size", "temperature"))
    coords = {"size": [8, 16], "temperature": [1.5, 2.0, 3.0]}
    table = xr.Dataset({"cumulant": figures}, coords)
    table.temperature.attrs["units"] = "J/k"
    text = sentence(tmp_path, {"swept": ["temperature", "size"]}, tables__cumulant=table)
    assert text.startswith(said)


def test_headline_gives_units_and_names_unitless_axes(tmp_path, smoke_store, sisters):
    table = xr.Dataset({"height": ("ripeness", [1.0, 4.0])}, {"ripeness": [1.0, 2.0]})
    table.height.attrs["units"] = "m"
    text = sentence(tmp_path, {"swept": ["ripeness"]}, tables__apples=table)
    assert text == "Height rises from 1 m at ripeness 1 to 4 m at ripeness 2."
    for path in (smoke_store, sisters):
        assert headline(read_frames(path), {})[0].endswith((".", "wide."))


@pytest.mark.parametrize(
    ("acn", "others", "axis"),
    [
        ({"cnr": [5.0, 10.0, 20.0], "range": [25.0, 50.0]}, {}, "cnr_db"),
        ({"cnr": [5.0, 10.0], "range": [25.0, 50.0, 75.0]}, {}, "range_km"),
        ({"range": [25.0, 50.0, 75.0], "vigilance": [0.8, 0.85, 0.9, 0.95]}, {}, "vigilance"),
        (
            {"range": [25.0, 50.0, 75.0], "vigilance": [0.8, 0.85, 0.9, 0.95]},
            {"range": [25.0, 50.0, 75.0]},
            "range_km",
        ),
    ],
    ids=["more values", "more values of the second", "one classifier", "of both classifiers"],
)
def test_main_axis_has_the_most_steps_of_all_classifiers(tmp_path, acn, others, axis):
    tables = {"tables__acn": displayed(scores(0, **acn))}
    if others:
        tables["tables__likelihood"] = displayed(scores(1, **others), "likelihood")
    path = stored(tmp_path / "s.zarr", {}, **tables)
    assert main_axis(main_frame(read_frames(path)), [*acn]) == axis
