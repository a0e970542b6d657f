"""A scan of the field of regard: what is found adds up, and takes the time that it should."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from commands import chosen, opened, swept
from rich.console import Console

from ncti.evaluate import wilson_interval
from ncti.ladar import noise_floor
from ncti.search import imaging_time, position_count
from sweeps.engine.errors import ConfigurationError
from sweeps.report import figures, scan_figures, scans
from sweeps.stages.scan import view_of
from sweeps.stages.scan_tables import DECOY
from sweeps.stages.scan_targets import box, source_of
from sweeps.stages.scan_visits import Templates, unit
from sweeps.stages.views import drawing_engine

SMALL = (
    *("sensor=scan", "grid.ship=[duncan,texas]", "grid.aspect={start: 0, stop: 90, step: 6}"),
    *("grid.range=[50,100]", "grid.frame_count=[2,16]", "grid.replicate=4", "scan.known_views=8"),
    *("render.engine=lines", "render.pixel=1", "render.samples=0", "infrared.false_alarm=1e-4"),
)
SINGLE = ("pulse_width",)
DRAWS, SHIPS = 4, 2


@pytest.fixture(scope="module")
def store(tmp_path_factory, cache):
    path = tmp_path_factory.mktemp("scan") / "s.zarr"
    assert not swept(path, cache, *SMALL).failures
    return path


@pytest.fixture(scope="module")
def scan(store):
    return opened(store, "scan").squeeze(SINGLE)


@pytest.fixture(scope="module")
def table(store):
    return opened(store, "tables/scan").squeeze(SINGLE)


def test_every_target_is_detected_or_not_and_every_detection_is_of_something(scan):
    assert (scan.detected == scan.right + scan.wrong + scan.turned_away).all()
    assert (scan.decoys == 1).all() and (scan.decoys_rejected <= scan.decoys_detected).all()
    assert (scan.false_rejected <= scan.false).all()
    there = (scan.source > -2).sum("detection")
    assert (there == scan.detected + scan.decoys_detected + scan.false).all()
    # Targets lie so far apart that none shares a detection here.
    seen = scan.hot > 0
    assert (seen.isel(target=slice(SHIPS)).sum("target") == scan.detected).all()
    assert (seen.sel(target=DECOY) == scan.decoys_detected).all()
    assert ((scan.hot <= scan.shown) & (scan.shown > 0)).all()
    assert ((scan.accepted >= 0) == (scan.source > -2)).all()


def test_near_ships_are_seen_and_far_ones_by_chance(scan):
    assert (scan.detected.sel(range=50) == SHIPS).all()
    assert (scan.chance.sel(range=50) > 0.999).all()
    assert ((scan.chance.sel(range=100) < 0.9) & (scan.chance.sel(range=100) > 0)).all()


def test_time_is_the_closed_form_of_the_visits(scan):
    edge = scan.visit.where(scan.source > -2, 0)
    columns, rows = (
        (edge.sel(edge=last) - edge.sel(edge=first)) // 2
        for first, last in (("left", "right"), ("bottom", "top"))
    )
    places = (columns * rows).sum("detection")
    np.testing.assert_allclose(
        scan.dwelling, (places * scan.frame_count / 1000).transpose(*scan.dwelling.dims)
    )
    visits = (scan.source > -2).sum("detection")
    np.testing.assert_allclose(scan.slewing.isel(frame_count=0), 0.1 * visits)
    field = {"width": np.radians(3), "height": np.radians(2)}
    rate = {"pixels": 256, "frame_count": 16, "frame_rate": 30.0, "slew_time": 0.1}
    assert np.allclose(scan.imaging, imaging_time(**field, ifov=150e-6, **rate))
    whole = position_count(**field, element=150e-6)
    np.testing.assert_allclose(scan.alone.sel(frame_count=16), whole * 16 / 1000)
    np.testing.assert_allclose(scan.total, scan.imaging + scan.slewing + scan.dwelling)


def test_the_sea_is_no_ship_and_what_is_near_is_named(scan):
    """Of some 70 visits to the sea; two ships at 50 km, at aspects between; by 16 frames."""
    long = scan.sel(frame_count=16)
    assert int(long.false.sum()) > 30
    assert (long.false == long.false_rejected).all()
    assert float(long.similarity.where(scan.source == -1).max()) < float(long.least.min())
    assert int(long.right.sel(range=50).sum()) >= SHIPS * DRAWS - 2


def test_the_decoy_is_never_counted_as_a_ship(scan):
    names = scan.target.values.tolist()
    assert names == ["duncan", "texas", DECOY]
    asked = scan.named.values[scan.named.values > -2]
    assert set(asked.tolist()) <= set(range(SHIPS))  # no template is the decoy's
    assert scan_figures.outcome(2, 1, True, SHIPS) == "wrong"
    assert scan_figures.outcome(2, 2, True, SHIPS) == "wrong"
    assert scan_figures.outcome(1, 1, True, SHIPS) == "right"
    assert scan_figures.outcome(1, 1, False, SHIPS) == "rejected"


def test_a_barge_looks_least_like_a_ship_from_ahead():
    """Noiseless profiles: a box has a bow and a deck, and no houses between."""
    import ncti.ships
    from ncti.ladar import expected_profile, range_extent
    from ncti.render import line_image

    def profile(mesh, aspect):
        seen = line_image(mesh, aspect=aspect, depression=3.84, spacing=0.5)
        extent = range_extent(seen, slant_range=50e3, ifov=150e-6, bin_width=1.0, window=250.0)
        return expected_profile(extent, pulse_width=30e-9, cnr=6300.0)

    ships = [ncti.ships.load(name) for name in ("duncan", "texas")]
    barge = box(120.0, 20.0, 8.0)
    cosines = {}
    for aspect in (10.0, 80.0):
        near = np.stack([profile(ship, a) for ship in ships for a in aspect + np.arange(-4, 5, 2)])
        cosines[aspect] = float((unit(profile(barge, aspect)[None]) @ unit(near).T).max())
    assert cosines[10.0] < 0.85 < cosines[80.0]


def test_aspects_are_fresh_and_the_same_at_every_range(scan):
    aspects = scan.true_aspect
    assert (aspects.sel(range=50) == aspects.sel(range=100)).all()
    assert len(np.unique(aspects)) == DRAWS * (SHIPS + 1)
    assert ((aspects > 0) & (aspects < 90)).all()
    assert (np.abs(aspects / 6 - np.round(aspects / 6)) > 1e-4).all()  # of no template


def test_a_seed_is_a_scan_and_company_changes_nothing(scan, tmp_path, cache):
    alone = ("grid.range=100", "grid.frame_count=16", "grid.replicate=2")
    assert not swept(tmp_path / "a.zarr", cache, *SMALL, *alone).failures
    assert not swept(tmp_path / "b.zarr", cache, *SMALL, *alone, "seed=1").failures
    same, other = (opened(tmp_path / f"{name}.zarr", "scan").squeeze() for name in "ab")
    here = scan.sel(range=100, frame_count=16, replicate=[0, 1])
    for name in ("true_aspect", "hot", "chance", "detected", "right", "total", "least"):
        assert np.array_equal(same[name], here[name]), name
    assert not np.array_equal(same.true_aspect, other.true_aspect)
    assert not np.array_equal(same.visit, other.visit)


def test_the_table_counts_all_draws(scan, table):
    assert (table.draws == DRAWS).all()
    right = scan.right.sum("replicate").transpose(*table.share_right.dims)
    of = scan.detected.sum("replicate").transpose(*right.dims)
    np.testing.assert_allclose(table.share_right, right / of.where(of > 0))
    low, high = wilson_interval(right, of)
    np.testing.assert_allclose(table.share_right_low, low)
    np.testing.assert_allclose(table.share_right_high, high)
    assert (table.share_detected_of == DRAWS * SHIPS).all()
    np.testing.assert_allclose(table.gain, table.alone / table.total)
    whole = table.share_right + table.share_wrong + table.share_away
    assert np.allclose(whole.where(of > 0, 1), 1)


def test_it_is_printed_and_drawn(store, tmp_path, monkeypatch):
    console = Console(width=120, record=True, file=(tmp_path / "out").open("w"))
    scans.print_scan(scans.scan_rows(opened(store, "tables/scan")), console)
    said = console.export_text()
    assert "Scan of the field of regard (30 ns)" in said
    assert "97-100" not in said.split("km")[0]
    picture = tmp_path / "scan.png"
    monkeypatch.setattr(sys, "argv", ["figures", "scan", str(store), str(picture)])
    figures.main()
    assert 10_000 < picture.stat().st_size < 250_000


def test_a_picture_of_one_value_of_each_axis_is_drawn(tmp_path, cache):
    one = ("grid.range=50", "grid.frame_count=16", "grid.replicate=1", "scan.decoy=none")
    assert not swept(tmp_path / "s.zarr", cache, *SMALL, *one).failures
    found = opened(tmp_path / "s.zarr", "scan")
    assert found.target.values.tolist() == ["duncan", "texas"]
    assert found.decoys.item() == 0
    assert figures.draw("scan", tmp_path / "s.zarr").axes
    row = scans.scan_rows(opened(tmp_path / "s.zarr", "tables/scan"))[0]
    assert row["percent_rejected"] is None and row["rejected_of"] == 0


# The parts


def templates_of(rng, bins=60):
    """Three ships of two views each, without noise of their own but what IFOVs have."""
    mean = noise_floor() * 4 + 20 * rng.random((6, bins)) * (np.abs(np.arange(bins) - 30) < 20)
    band = np.ones((6, 1, bins))
    noise = np.full(bins, noise_floor()), np.full((1, bins), 2 - np.pi / 2)
    ship = np.repeat(np.arange(3), 2)
    return Templates(mean, band, np.full(6, 4), ship, noise, 1e-3, 1.0)


@pytest.mark.parametrize("ifovs", [4, 20, 21, 23, 100])
def test_a_template_is_its_ship_by_visits_of_any_size(ifovs):
    known = templates_of(np.random.default_rng(2))
    frames = known.mean + (ifovs - 4) * noise_floor()
    ship, similarity = known.named(frames, 16, ifovs)
    assert ship.tolist() == [0, 0, 1, 1, 2, 2]
    np.testing.assert_allclose(similarity, 1.0)


def test_classifiers_of_a_few_sizes_are_kept():
    known = templates_of(np.random.default_rng(2))
    for ifovs in range(4, 4000, 50):
        known.named(known.mean[:1] + (ifovs - 4) * noise_floor(), 16, ifovs)
    assert len(known._fitted) <= 8


def test_a_detection_is_of_the_target_with_most_of_its_pixels():
    assert source_of(np.array([-1, -1, 2, 1, 2]), 3) == 2
    assert source_of(np.array([-1, -1]), 3) == -1


def test_a_view_has_the_depression_and_the_size_of_its_own_range():
    """A barge abeam, at 40 to 60 km: its side and its deck, at the depression of its own range."""
    barge = box(120.0, 20.0, 8.0)
    look = {"depth": 0.2, "slant_range": 50e3, "depression": 3.84, "most": (60, 20)}
    drawn = (drawing_engine("lines", None), 0.1, 0, 31.7)
    bins = (150e-6, 1.0, 250.0, 0.5)
    for seed in range(4):
        seen = view_of(barge, np.random.default_rng(seed), (90.0,), **look, drawn=drawn, bins=bins)
        far = float(seen["slant_range"])
        assert 40e3 <= far <= 60e3 and seen["fraction"].shape == (61 * 21, 250)
        area = seen["fraction"].sum() * (150e-6 * far) ** 2
        down = np.arcsin(50e3 * np.sin(np.radians(3.84)) / far)
        exact = 120 * (8 * np.cos(down) + 20 * np.sin(down))
        assert area == pytest.approx(
            exact, rel=0.005
        )  # lines of 0.1 m; a deck at 3.84 deg would be 2 % off at 60 km


# What is refused

WRONG = {
    "scan.pulse_rate=2000": "scan.pulse_rate has 2000, but must be at most 1428 Hz",
    "grid.range=20": "grid.range has 20, but must be at least 22.9 km for 3 targets",
    "ladar.ifov=100": "infrared.ifov has 150, but must be one number and that of ladar.ifov",
    "ladar.reflectance=lambertian": "ladar.reflectance has lambertian, but must be projected_area",
    "ladar.receiver=peak_pulse": "ladar.receiver is 'peak_pulse', but must be full_profile",
    "render.tolerance=0.01": "render.tolerance has 0.01, but must be null with the sensor scan",
    "scan.decoy_length=300": "scan.decoy_length has 300, but must be less",
    "scan.decoy_height=80": "scan.decoy_height has 80, but must be less",
    "scan.height=0.1": "scan.depth has 0.05, but must be less for targets at 50 km",
    "infrared.window_length=100": "infrared.window_length is 100 m, but must be at least",
}


@pytest.mark.parametrize("override", WRONG)
def test_what_cannot_be_searched_is_refused(override):
    with pytest.raises(ConfigurationError) as caught:
        chosen(*SMALL, override)
    assert WRONG[override] in str(caught.value)
    assert "\n" not in str(caught.value)
