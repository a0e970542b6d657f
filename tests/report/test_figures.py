import sys

import numpy as np
import pytest
import trimesh
import zarr
from stores import rows_of

from sweeps.report import figures, ship_figures
from sweeps.report.style import OFFSET


def grey(down_range):
    return np.ones((*np.shape(down_range), 3))


@pytest.fixture(scope="module")
def box():
    return trimesh.creation.box(extents=(30.0, 10.0, 8.0))


def test_portrait_has_the_area_and_the_place_of_the_ship(box):
    pixel = 0.5
    picture = ship_figures.portrait(box, aspect=90.0, depression=0.0, pixel=pixel, tint=grey)
    # The beam of the box, 30 m by 8 m about the origin; pixels of the image fit it exactly.
    assert picture.colour[..., 3].sum() * pixel**2 == pytest.approx(30.0 * 8.0)
    left, right, bottom, top = picture.extent
    rows, columns = picture.colour.shape[:2]
    assert (right - left, top - bottom) == pytest.approx((columns * pixel, rows * pixel))
    seen = np.nonzero(picture.colour[..., 3] == 1.0)
    assert left + pixel * (seen[1].mean() + 0.5) == pytest.approx(0.0, abs=pixel / 2)
    assert bottom + pixel * (seen[0].mean() + 0.5) == pytest.approx(0.0, abs=pixel / 2)


def test_face_towards_the_sensor_gets_the_whole_headlight(box):
    picture = ship_figures.portrait(box, aspect=90.0, depression=0.0, pixel=0.5, tint=grey)
    _, _, towards = np.array(ship_figures.LIGHT) / np.linalg.norm(ship_figures.LIGHT)
    expected = ship_figures.AMBIENT + ship_figures.HEADLIGHT + ship_figures.KEYLIGHT * towards
    inside = picture.colour[picture.colour[..., 3] == 1.0]
    np.testing.assert_allclose(inside[:, :3], min(expected, 1.0), rtol=1e-6)


def test_light_from_above_makes_a_deck_brighter_than_a_side_as_steep(box):
    # Seen 45 degrees from above, both have one angle of incidence, and only the deck has the sky.
    picture = ship_figures.portrait(box, aspect=90.0, depression=45.0, pixel=0.5, tint=grey)
    column = picture.colour[:, picture.colour.shape[1] // 2]
    solid = column[column[:, 3] == 1.0, 0]
    assert solid[-3] > solid[2]


OF_OTHERS = {
    "flight",
    "validation",
    "sensitivity",
    "measured",
    "runtime_vs_error",
    "scan",
    "spacing",
}


@pytest.mark.parametrize("kind", sorted(figures.KINDS.keys() - OF_OTHERS))
def test_pictures_of_a_store_are_small_enough_for_a_page(kind, smoke_store, tmp_path, monkeypatch):
    picture = tmp_path / f"{kind}.png"
    monkeypatch.setattr(sys, "argv", ["figures", kind, str(smoke_store), str(picture)])
    figures.main()
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert 10_000 < picture.stat().st_size < 250_000


def told(monkeypatch, capsys, *arguments):
    """What the command says when it cannot draw."""
    monkeypatch.setattr(sys, "argv", ["figures", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        figures.main()
    assert caught.value.code == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


@pytest.mark.parametrize("kind", ["profiles", "silhouettes", "flight", "runtime_vs_error"])
def test_a_store_that_lacks_what_is_drawn_is_refused_in_one_sentence(
    kind, tmp_path, monkeypatch, capsys
):
    absent, empty = tmp_path / "absent.zarr", tmp_path / "empty.zarr"
    zarr.create_group(empty)
    for store in (absent, empty):
        said = told(monkeypatch, capsys, kind, store, tmp_path / "picture.png")
        assert f"{kind} cannot be drawn" in said


def test_a_store_without_classifiers_is_refused_in_one_sentence(sisters, monkeypatch, capsys):
    assert "classifiers cannot be drawn" in told(
        monkeypatch, capsys, "classifiers", sisters, "picture.png"
    )


@pytest.mark.parametrize("kind", ["classifiers", "fusion"])
def test_percentages_have_a_panel_a_bin(kind, smoke_store):
    titles = [axes.get_title() for axes in figures.draw(kind, smoke_store).axes]
    assert titles == ["aspect 0–15°", "aspect 30–45°", "aspect 60–90°", "overall"]


def test_lines_are_the_tables(smoke_store):
    figure = figures.draw("classifiers", smoke_store)
    overall = figure.axes[-1]
    handles, labels = overall.get_legend_handles_labels()
    lines = dict(zip(labels, handles, strict=True))
    assert {"ACN", "MNN, ship + aspects", "correlation"} <= set(lines)
    for name, classifier in (("ACN", "acn"), ("correlation", "correlation")):
        expected = {
            float(row["frame_count"]): float(row["percent_correct"])
            for row in rows_of(smoke_store, "classifiers")
            if row["classifier"] == classifier
            and row["pulse_width_ns"] == "30.0"
            and row["aspect_bin_deg"] == "overall"
            and row["frame_count"]
            and row["vigilance"] in ("", "0.95")
        }
        x, y = lines[name].lines[0].get_data()
        np.testing.assert_allclose(np.asarray(x, float), sorted(expected), rtol=OFFSET)
        np.testing.assert_array_equal(
            np.asarray(y, float), [expected[count] for count in sorted(expected)]
        )


def test_fusion_shows_three_channels(smoke_store):
    figure = figures.draw("fusion", smoke_store)
    for axes in figure.axes:
        assert axes.get_legend_handles_labels()[1] == ["silhouette", "range profile", "both"]
