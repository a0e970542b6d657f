"""Variants are reproducible closed ships that vary within the uncertainty of their sheets."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import yaml
from shipyard import barge, packaged_sheet

from ncti import ships
from ncti.ships import build, perturbation, sheets
from ncti.ships.perturbation import Variant, build_variant, perturb_sheet, support_tree

DRAWS = {"connole": 2, "duncan": 2, "spruance": 10}  # a second each


def parsed(document) -> sheets.Sheet:
    return sheets.parse(yaml.safe_dump(document), "{}", where="barge")


def roots(sheet: sheets.Sheet) -> np.ndarray:
    """Return the middles of footprints [m], (component, 3)."""
    return np.array(
        [
            (*c.sizes["outline"].mean(axis=0), c.at[2]) if "outline" in c.sizes else c.at
            for c in sheet.components
        ]
    )


@pytest.fixture(scope="module")
def drawn() -> dict[str, list[sheets.Sheet]]:
    """Return some perturbed sheets of each of three ships."""
    by_ship = {}
    for name in DRAWS:
        sheet = packaged_sheet(name)
        borne = support_tree(sheet)
        by_ship[name] = [
            perturb_sheet(sheet, borne, rng=Variant(name, 0, number).stream(0), scale=1.0)
            for number in range(1, DRAWS[name] + 1)
        ]
    return by_ship


@pytest.mark.parametrize("name", ships.names())
def test_variant_is_one_closed_solid_of_nominal_dimensions(name) -> None:
    mesh, nominal = ships.load(f"{name}@0.1"), ships.load(name)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    assert mesh.body_count == 1
    assert mesh.metadata["name"] == f"{name}@0.1"
    assert mesh.metadata["variant_of"] == name and nominal.metadata["variant_of"] is None
    for size in ("loa", "beam"):
        assert mesh.metadata[size] == pytest.approx(nominal.metadata[size], abs=0.01)
    assert mesh.metadata["digest"] != nominal.metadata["digest"]
    assert mesh.metadata["digest"] == ships.digest(f"{name}@0.1")
    assert ships.describe(f"{name}@0.1").findings == ()


@pytest.mark.parametrize("name", DRAWS)
def test_displacements_stay_within_uncertainty(drawn, name) -> None:
    """Moves have two parts, each cut off at two sigma, with a total variance of one at most."""
    sheet = packaged_sheet(name)
    sigma = np.array([c.sigma for c in sheet.components])[:, None] * [1, 0.5, 0.7]
    moved = np.array([roots(variant) - roots(sheet) for variant in drawn[name]]) / sigma
    assert np.abs(moved[..., 0]).max() <= 2 * np.sqrt(2)
    assert np.sqrt((moved[..., :1] ** 2).mean()) <= 1
    # Heights follow the deck below a part, breadths the deck edge: another sigma at most.
    assert np.quantile(np.abs(moved), 0.99) <= 3
    lines = sheet.hull.stations
    for variant in drawn[name]:
        assert variant.hull.loa == sheet.hull.loa
        assert variant.hull.stations[:, 2].max() == lines[:, 2].max()
        assert np.abs(variant.hull.stations[:, 2:] / lines[:, 2:] - 1)[:, 0].max() <= 2 * 0.03
        amidships = [c.at[1] == 0 for c in sheet.components]
        assert all(
            c.at[1] == 0 for c, is_so in zip(variant.components, amidships, strict=True) if is_so
        )


def test_free_standing_part_varies_by_its_uncertainty(drawn) -> None:
    """A free-standing part on the deck, an E line of 1.5 m, moves by most of that."""
    sheet = packaged_sheet("spruance")
    number = [c.name for c in sheet.components].index("capstans/windlass")
    x = [roots(variant)[number, 0] for variant in drawn["spruance"]]
    # The deviation of ten draws is 0.5 to 1.5 times the true one at a level of 2 %.
    assert 0.5 * 1.5 * 0.8 < np.std(x) < 1.5 * 1.5


def test_same_ship_from_any_cache_and_count(tmp_path) -> None:
    (first,) = ships.variants("connole", 1, seed=3, cache=tmp_path / "a")
    again, second = ships.variants("connole", 2, seed=3, cache=tmp_path / "b")
    np.testing.assert_array_equal(first.vertices, again.vertices)
    np.testing.assert_array_equal(first.faces, again.faces)
    reloaded = ships.load("connole@3.1", cache=tmp_path / "a")
    np.testing.assert_array_equal(reloaded.vertices, first.vertices)
    assert first.metadata["digest"] != second.metadata["digest"]
    assert len(list((tmp_path / "b").glob("*.npz"))) == 2


def test_displacements_vanish_linearly_with_scale() -> None:
    sheet = packaged_sheet("duncan")
    borne, variant = support_tree(sheet), Variant("duncan", 0, 1)
    near, far = (
        roots(perturb_sheet(sheet, borne, rng=variant.stream(0), scale=scale)) - roots(sheet)
        for scale in (1e-3, 2e-3)
    )
    assert np.abs(near).max() < 0.01
    # Moves are proportional to the scale, to second order in the warp's slope.
    np.testing.assert_allclose(far, 2 * near, atol=1e-4)


def test_size_scales_the_whole_ship() -> None:
    variant, small = (ships.load(name) for name in ("texas@0.1x2", "texas@0.1x2s0.8"))
    np.testing.assert_array_equal(small.vertices, 0.8 * variant.vertices)
    np.testing.assert_array_equal(small.faces, variant.faces)
    for size in ("loa", "beam"):
        assert small.metadata[size] == 0.8 * variant.metadata[size]
    assert small.metadata["variant_of"] == "texas" and small.metadata["name"] == "texas@0.1x2s0.8"


def test_symmetric_ship_stays_symmetric() -> None:
    document = barge()
    document["components"] = [
        line
        for line in document["components"]
        if line.get("mirror") or (line.get("y", 1) == 0 and line["prim"] != "eq")
    ]
    sheet = parsed(document)
    mirrored = build.build(sheet)
    for number in (1, 2, 3):
        ship = build_variant(sheet, support_tree(sheet), Variant("barge", 0, number, 0.3))
        for built in (mirrored, ship):
            low, high = built.vertices.min(axis=0)[1], built.vertices.max(axis=0)[1]
            assert low == pytest.approx(-high, abs=1e-6)
        mesh = trimesh.Trimesh(ship.vertices, ship.faces, process=False)
        assert ships.is_symmetric(mesh)


def test_source_tag_sets_the_default_uncertainty() -> None:
    document = barge()
    line = document["components"][0]
    line.pop("unc", None)
    sigmas = {}
    for tag in ("P", "M", "G", "E", "M+E", "E/M", "somewhere"):
        line["src"] = tag
        sigmas[tag] = parsed(document).components[0].sigma
    assert sigmas["P"] < sigmas["M"] < sigmas["G"] < sigmas["E"]
    assert sigmas["M+E"] == sigmas["E/M"] == sigmas["somewhere"] == sigmas["E"]
    line["unc"] = 0.25
    assert parsed(document).components[0].sigma == 0.25


def test_unbuildable_draws_are_redrawn(monkeypatch) -> None:
    """If the first two draws do not build, the third is built, from its own stream."""
    sheet = parsed(barge())
    borne, variant = support_tree(sheet), Variant("barge", 0, 1, 0.3)
    drawn = []

    def build_third(perturbed_sheet):
        drawn.append(perturbed_sheet)
        if len(drawn) < 3:
            raise ships.ShipError("floats in the air")
        return build.build(perturbed_sheet)

    monkeypatch.setattr(perturbation, "build", build_third)
    ship = build_variant(sheet, borne, variant)
    third = perturb_sheet(sheet, borne, rng=variant.stream(2), scale=variant.scale)
    np.testing.assert_array_equal(ship.vertices, build.build(third).vertices)
    assert not np.array_equal(roots(drawn[0]), roots(drawn[1]))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("duncan@0.0", "numbered from 1"),
        ("duncan@0.01", "needless digits"),
        ("duncan@0.1x1.2.3", "needless digits"),
        ("duncan@0.1x5", "scale 5"),
        ("duncan@0.1s0.8x2", "SHIP@SEED.NUMBERxSCALEsSIZE"),
        ("duncan@7", "must be SHIP@SEED.NUMBER, numbered from 1 on"),
        ("duncan@0.1x2s3", "size 3"),
        ("bismarck@0.1", "unknown ship"),
    ],
)
def test_invalid_variant_name_is_refused(value, message) -> None:
    with pytest.raises(ships.ShipError, match=message):
        ships.digest(value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "duncan@0.1"}, "name"),
        ({"count": 0}, "count"),
        ({"count": 1.5}, "count"),
        ({"seed": -1}, "seed"),
        ({"scale": 0.0}, "scale"),
    ],
)
def test_invalid_arguments_are_refused(change, message) -> None:
    with pytest.raises(ships.ShipError, match=message):
        ships.variants(**({"name": "duncan", "count": 1} | change))
