"""The report finds the two ships most often confused, and its page shows their picture."""

import numpy as np
import xarray as xr
from made import displayed, scores
from pages import page_of, parsed, read_page, stored

from sweeps.report.confusion import confusion_frame, most_confused, read_predictions
from sweeps.report.frames import read_frames
from sweeps.report.outputs import page_file
from sweeps.report.stores import open_store

SHIPS, ASPECTS = ["duncan", "horne", "texas"], [0.0, 30.0, 60.0]


def answers(order=(0, 1, 2), wrong=(), cnr=(5.0, 10.0)):
    """Return answers that are right except at each (true, named, aspect), for ships in an order."""
    named = np.tile(np.arange(3)[:, None], (len(cnr), 1, 3))
    for true, other, aspect in wrong:
        named[:, order.index(true), aspect] = order.index(other)
    coords = {"cnr": list(cnr), "ship": [SHIPS[k] for k in order], "aspect": ASPECTS}
    return xr.Dataset({"predicted": (("cnr", "ship", "aspect"), named)}, coords)


def test_most_confused_pair_counts_both_directions_and_all_classifiers(tmp_path):
    """Two classifiers name Duncan Horne at 0, Texas Horne at 30, and one Horne Texas at 60 deg."""
    groups = {
        "classification__acn": answers(wrong=[(0, 1, 0), (2, 1, 1)]),
        "classification__mnn": answers((2, 0, 1), wrong=[(2, 1, 1), (1, 2, 2), (0, 1, 0)]),
    }
    confused = most_confused(read_predictions(open_store(stored(tmp_path / "s.zarr", **groups))))
    assert confused == (("horne", "texas"), 30.0)


def test_without_wrong_answers_no_ships_are_confused(tmp_path):
    groups = {"classification__acn": answers(), "tables__acn": displayed(scores(cnr=[5.0, 10.0]))}
    path = stored(tmp_path / "s.zarr", **groups)
    assert most_confused(read_predictions(open_store(path))) is None
    assert not parsed(page_of(path)).root.all("section", id="confused")
    without = open_store(stored(tmp_path / "t.zarr", tables__acn=scores(a=[1])))
    assert most_confused(read_predictions(without)) is None


def test_page_shows_a_picture_of_the_most_confused_ships(smoke_store):
    (section,) = read_page(page_file(smoke_store)).root.all("section", id="confused")
    assert section.only("img").attrs["src"].startswith("data:image/png;base64,")


def test_failing_to_join_answers_does_not_prevent_the_page(tmp_path):
    twice = answers(wrong=[(0, 1, 0)]).assign_coords(aspect=[0.0, 30.0, 30.0])
    groups = {"classification__acn": answers(), "classification__mnn": twice}
    groups |= {
        "range_profile": xr.Dataset({"image": ("x", [1.0])}),
        "tables__acn": displayed(scores(cnr=[5.0, 10.0])),
    }
    root = parsed(page_of(stored(tmp_path / "s.zarr", **groups))).root
    (section,) = root.all("section", id="confused")
    assert "Error" in section.text and not section.all("img")


def test_every_scored_classifier_has_a_confusion_matrix(smoke_store):
    frames = read_frames(smoke_store)
    matrix = confusion_frame(read_predictions(open_store(smoke_store)), frames)
    pairs = ["classifier", "channel"]
    scored = frames["scores"].rows
    assert {*map(tuple, matrix.rows[pairs].values)} == {*map(tuple, scored[pairs].values)}
    assert "scored" not in matrix.columns  # or the page would leave out classifiers without it
