"""The first sentence of a report: what was identified how often, where, with chance."""

import re

from made import SHIPS, scores, shown
from pages import stored

from sweeps.engine.declare.display import ATTRIBUTE, Display, Figure
from sweeps.engine.declare.storable import encode_attrs
from sweeps.report.frames import read_frames
from sweeps.report.headline import headline

GIVEN = {"grid": {"ship": list(SHIPS)}}


def sentence(tmp_path, attributes, **tables):
    path = stored(tmp_path / "s.zarr", attributes, **tables)
    return headline(read_frames(path), attributes)[0]


def test_it_is_along_the_axis_that_was_swept(tmp_path):
    table = scores(cnr=[23.0, 26.0, 32.0], frame_count=[4, 16], range=100.0)
    about = {"configuration": GIVEN, "swept": ["cnr"]}
    said = sentence(tmp_path, about, tables__acn=shown(table))
    at = table.sel(aspect_bin="overall", frame_count=16)
    for cnr in (23.0, 32.0):
        one = at.sel(cnr=cnr)
        ends = (float(one.accuracy), float(one.ci_low), float(one.ci_high))
        share, low, high = (f"{round(100 * end, 1):.0f}" for end in ends)
        assert f"{share} % [{low}–{high}] at cnr {cnr:g} dB" in said
    assert said.startswith("ACN on range profiles identifies") and "of four ships" in said
    assert "range 100 km" in said and "frame count 16" in said and said.endswith("chance 25 %.")


def test_the_best_classifier_is_named_and_few_answers_are_said(tmp_path):
    best, worst = scores(frame_count=[16]), scores(frame_count=[16])
    for name, share in ((best, 0.9), (worst, 0.3)):
        name.accuracy[:], name.n[:] = share, 8
    given = {
        "configuration": {
            "grid": {"ship": ["duncan", "texas"]},
            "classifier": {"unknown": ["texas"]},
        }
    }
    tables = {"tables__acn": shown(worst), "tables__likelihood": shown(best, "likelihood")}
    said = sentence(tmp_path, given, **tables)
    assert said.startswith("Maximum likelihood") and "of one ship" in said
    assert re.search(r"Few answers \(n = 8\)", said)


def test_of_other_percentages_the_best_row_is_named_where_it_is_asked_first(tmp_path):
    import xarray as xr

    share = xr.DataArray([[0.2, 0.6], [0.9, 0.1], [0.3, 0.5]], dims=("tree", "split"))
    table = xr.Dataset(
        {"share": share}, {"tree": ["ash", "elm", "oak"], "split": ["a-gap", "aspect-random"]}
    )
    figure = Figure("share", "percent_correct", percent=True, format=".0f")
    display = Display("trees", "Trees", (figure,), rows=("tree",), columns="split", chance=25.0)
    table = table.assign_attrs(encode_attrs({ATTRIBUTE: [display.as_attribute(None)]}))
    said = sentence(tmp_path, {"swept": []}, tables__trees=table)
    assert said.startswith("Percent correct: 60 % ") and said.endswith("; chance 25 %.")
    assert "ash" in said and "aspect-random" in said


def test_any_table_has_a_headline(smoke_store, sisters, tmp_path):
    import xarray as xr

    table = xr.Dataset({"height": ("ripeness", [1.0, 4.0])}, {"ripeness": [1.0, 2.0]})
    table.height.attrs["units"] = "m"
    said = sentence(tmp_path, {"swept": ["ripeness"]}, tables__apples=table)
    assert said == "Height: 1 m at ripeness 1 and 4 m at ripeness 2."
    for path in (smoke_store, sisters):
        assert headline(read_frames(path), {})[0].endswith((".", "wide."))
