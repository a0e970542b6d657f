"""Detections of a scan of the field of regard add up, and their times have closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from commands import opened, swept

from ncti.evaluate import wilson_interval
from ncti.render import Sampling
from studies.scan.schedule import imaging_time, position_count
from studies.scan.stages import DECOY
from studies.scan.targets import Survey, box, owner
from studies.scan.visits import outcomes

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


def test_detection_counts_are_consistent(scan):
    assert (scan.detected == scan.right + scan.wrong + scan.turned_away).all()
    assert (scan.decoys == 1).all() and (scan.decoys_rejected <= scan.decoys_detected).all()
    assert (scan.false_rejected <= scan.false).all()
    valid = (scan.source > -2).sum("detection")
    assert (valid == scan.detected + scan.decoys_detected + scan.false).all()
    # Targets lie so far apart that none shares a detection here.
    hot = scan.hot > 0
    assert (hot.isel(target=slice(SHIPS)).sum("target") == scan.detected).all()
    assert (hot.sel(target=DECOY) == scan.decoys_detected).all()
    assert ((scan.hot <= scan.shown) & (scan.shown > 0)).all()
    assert ((scan.accepted >= 0) == (scan.source > -2)).all()


def test_search_time_matches_the_closed_form(scan):
    visits = (scan.source > -2).sum("detection")
    np.testing.assert_allclose(scan.slewing.isel(frame_count=0), 0.1 * visits)
    field = {"width": np.radians(3), "height": np.radians(2)}
    rate = {"pixels": 256, "frame_count": 16, "frame_rate": 30.0, "slew_time": 0.1}
    assert np.allclose(scan.imaging, imaging_time(**field, ifov=150e-6, **rate))
    positions = position_count(**field, element=150e-6)
    np.testing.assert_allclose(scan.exhaustive.sel(frame_count=16), positions * 16 / 1000)
    np.testing.assert_allclose(scan.total, scan.imaging + scan.slewing + scan.dwelling)


def test_sea_is_rejected_and_near_ships_are_identified(scan):
    """By 16 frames some 70 visits to the sea are rejected, and two ships at 50 km are named."""
    long = scan.sel(frame_count=16)
    assert int(long.false.sum()) > 30
    assert (long.false == long.false_rejected).all()
    assert float(long.similarity.where(scan.source == -1).max()) < float(long.threshold.min())
    assert int(long.right.sel(range=50).sum()) >= SHIPS * DRAWS - 2


def test_the_decoy_is_never_counted_as_a_ship(scan):
    names = scan.target.values.tolist()
    assert names == ["duncan", "texas", DECOY]
    answers = scan.named.values[scan.named.values > -2]
    assert set(answers.tolist()) <= set(range(SHIPS))  # no template is the decoy's


def test_cell_results_do_not_depend_on_other_cells(scan, tmp_path):
    overrides = ("grid.range=100", "grid.frame_count=16", "grid.replicate=2")
    assert not swept(tmp_path / "a.zarr", tmp_path / "cache", *SMALL, *overrides).failures
    repeated = opened(tmp_path / "a.zarr", "scan").squeeze()
    part = scan.sel(range=100, frame_count=16, replicate=[0, 1])
    for name in (
        "true_aspect",
        "hot",
        "detection_probability",
        "detected",
        "right",
        "total",
        "threshold",
    ):
        assert np.array_equal(repeated[name], part[name]), name


def test_the_table_counts_all_draws(scan, table):
    assert (table.draws == DRAWS).all()
    right = scan.right.sum("replicate").transpose(*table.share_right.dims)
    detected = scan.detected.sum("replicate").transpose(*right.dims)
    np.testing.assert_allclose(table.share_right, right / detected.where(detected > 0))
    low, high = wilson_interval(right, detected)
    np.testing.assert_allclose(table.share_right_low, low)
    np.testing.assert_allclose(table.share_right_high, high)
    assert (table.share_detected_of == DRAWS * SHIPS).all()
    np.testing.assert_allclose(table.gain, table.exhaustive / table.total)
    total = table.share_right + table.share_wrong + table.share_away
    assert np.allclose(total.where(detected > 0, 1), 1)


# The parts


def test_detection_belongs_to_the_target_with_most_pixels():
    pixels = np.argwhere(np.ones((5, 1)))
    assert owner(pixels, np.array([[-1, -1, 2, 1, 2]])) == 2
    assert owner(pixels[:2], np.array([[-1, -1]])) == -1


def test_a_search_counts_ships_decoys_and_alarms():
    source, named = np.array([0, 1, 1, 2, -1]), np.zeros(5, int)
    counts = outcomes(source, named, np.array([True, True, False, False, False]), ships=2)
    assert {name: int(count) for name, count in counts.items()} == {
        **{"detected": 3, "right": 1, "wrong": 1, "turned_away": 1},
        **{"decoys_detected": 1, "decoys_rejected": 1, "false": 1, "false_rejected": 1},
    }


def test_view_has_the_depression_and_scale_of_its_own_range():
    """A barge abeam at 40 to 60 km shows side and deck, at the depression of its own range."""
    barge = box(120.0, 20.0, 8.0)
    scene = {"depth": 0.2, "slant_range": 50e3, "depression": 3.84, "length": 360, "height": 120}
    bins = {"ifov": 150e-6, "bin_width": 1.0, "window": 250.0, "spread": 0.5}
    survey = Survey(**scene, **bins, sampling=Sampling("lines", 0.1, 0, 31.7))
    for seed in range(4):
        arrays = survey.arrays(survey.target(barge, (90.0,), np.random.default_rng(seed)))
        far = float(arrays["slant_range"])
        assert 40e3 <= far <= 60e3 and arrays["fraction"].shape == (61 * 21, 250)
        area = arrays["fraction"].sum() * (150e-6 * far) ** 2
        down = np.arcsin(50e3 * np.sin(np.radians(3.84)) / far)
        exact = 120 * (8 * np.cos(down) + 20 * np.sin(down))
        # Lines are 0.1 m apart; a deck at 3.84 deg would be 2 % off at 60 km.
        assert area == pytest.approx(exact, rel=0.005)
