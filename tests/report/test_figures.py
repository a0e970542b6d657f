import sys

import numpy as np
import pytest
import trimesh

from sweeps.report import figures, ship_figures


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


@pytest.mark.parametrize("kind", ["profiles", "tables"])
def test_pictures_of_a_store(kind, smoke_store, tmp_path, monkeypatch):
    picture = tmp_path / f"{kind}.png"
    monkeypatch.setattr(sys, "argv", ["figures", kind, str(smoke_store), str(picture)])
    figures.main()
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_store_that_is_none_is_refused_in_one_sentence(tmp_path, monkeypatch, capsys):
    absent = tmp_path / "absent.zarr"
    monkeypatch.setattr(sys, "argv", ["figures", "profiles", str(absent), "picture.png"])
    with pytest.raises(SystemExit) as caught:
        figures.main()
    assert caught.value.code == 2
    assert "profiles cannot be drawn" in capsys.readouterr().err


def test_missing_matplotlib_is_told_in_one_sentence(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.setattr(sys, "argv", ["figures", "ships", str(tmp_path / "ships.png")])
    with pytest.raises(SystemExit) as caught:
        figures.main()
    assert caught.value.code == 2
    assert "ncti-sweep[plot]" in capsys.readouterr().err
