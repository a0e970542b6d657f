"""No split has a view, draw or variant of its test in training, by the drawn parameters."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy import stats

import ncti
from ncti.data.rows import parameters
from ncti.data.splits import (
    CNR_LOSS,
    FLOOR_DRIFT,
    GAIN_DRIFT,
    OUTSIDERS,
    SISTER,
    UNRELATED,
    VARIANTS,
    gap,
    recipe,
    same_training_split,
)
from ncti.ladar import range_extent, spread_place

SHIPS = ("duncan", "texas")
SEEDS = (0, 1, 12345)
COUNTS = {"train": 400, "test": 100, "unknown": 50}


class Drawn(dict):
    """Parameters drawn for the rows of a part, without building a ship."""

    def __init__(self, name, part, seed):
        ships, options = recipe(name, part, seed=seed, ships=SHIPS)
        numbers = np.arange(COUNTS[part])
        super().__init__(parameters(numbers, len(ships), **options))
        self["ship"] = np.array(ships)[self["ship"]]
        self.seed, self.of = options["seed"], seed  # of the data set, and of the split

    @property
    def views(self):
        """Return the views, counting the other side of a ship as its mirror image."""
        aspect = np.minimum(self["aspect"] % 360, -self["aspect"] % 360)
        return {*zip(self["ship"].tolist(), aspect.tolist(), self["depression"], strict=True)}

    @property
    def draws(self):
        """Return the keys of the noise streams: seed of the data set and number of the row."""
        return {(self.seed, row) for row in self["row"].tolist()}


@pytest.fixture(scope="module", params=SEEDS)
def splits(request):
    """Return the parts of all splits of a seed."""
    return {
        name: {
            part: Drawn(name, part, request.param)
            for part in COUNTS
            if part != "unknown" or name in OUTSIDERS
        }
        for name in ncti.data.SPLITS
    }


def test_training_shares_no_view_or_draw_with_any_test(splits):
    for learned in (parts["train"] for parts in splits.values()):
        for parts in splits.values():
            for tested in (parts[part] for part in parts if part != "train"):
                assert not learned.views & tested.views
                assert not learned.draws & tested.draws
                assert len(tested.draws) == len(tested["row"])


def test_seeds_have_no_view_and_no_draw_in_common():
    parts = [
        Drawn("aspect-random", part, seed) for part in ("train", "test") for seed in (0, 1, 2, 3)
    ]
    for what in ("views", "draws"):
        sets = [getattr(rows, what) for rows in parts]
        assert sum(map(len, sets)) == len(set().union(*sets))


def test_variants_are_learned_or_tested_but_not_both(splits):
    seed = splits["variant"]["test"].of
    learned, tested = (
        {*recipe("variant", part, seed=seed, ships=SHIPS)[0]} for part in ("train", "test")
    )
    assert not learned & tested
    assert {*splits["variant"]["test"]["ship"]} <= tested
    assert len(learned) == len(tested) == len(SHIPS) * VARIANTS // 2
    assert {name.partition("@")[0] for name in learned | tested} == {*SHIPS}
    assert all("@" in name for name in learned | tested)


def test_each_test_part_has_its_stated_shift(splits):
    train, test = splits["aspect-gap"].values()
    low, high = gap(test.of)
    assert high - low == 30.0
    assert ((test["aspect"] >= low) & (test["aspect"] < high)).all()
    assert not ((train["aspect"] >= low) & (train["aspect"] < high)).any()
    train, test = splits["range-shift"].values()
    assert {*train["slant_range"]} == {25e3} and {*test["slant_range"]} == {100e3}
    train, test = splits["sensor-shift"].values()
    np.testing.assert_allclose(test["cnr"], train["cnr"][0] - CNR_LOSS)
    assert {*train["gain"]} == {1.0} and {*train["floor"]} == {0.0}
    # Standard deviations of normal distributions: chi-square of 100 rows, level 1e-4.
    for name, sigma in (("gain", GAIN_DRIFT), ("floor", FLOOR_DRIFT)):
        squares = ((test[name] - train[name][0]) / sigma) ** 2
        assert 1e-4 < stats.chi2.sf(squares.sum(), len(squares)) < 1 - 1e-4
    train, test = splits["few-frames"].values()
    assert {*train["frames"]} == {16} and {*test["frames"]} == {2}
    for name, unknown in (("unknown-near", SISTER), ("unknown-far", UNRELATED)):
        assert {*splits[name]["unknown"]["ship"]} == {unknown}
        assert unknown not in splits[name]["train"]["ship"]


def test_splits_with_shared_training_draw_the_same_views(splits):
    for name, parts in splits.items():
        other = splits[same_training_split(name)]["train"]
        assert parts["train"].seed == other.seed and parts["train"].views == other.views
    plain, other = (splits[name]["test"] for name in ("aspect-random", "sensor-shift"))
    assert plain.views == other.views and plain.draws == other.draws


@pytest.fixture(scope="module")
def small():
    return ncti.data.split("unknown-near", seed=1, ships=SHIPS, train=16, test=4)


def test_rows_have_their_drawn_parameters(small):
    parts = {"train": small.train, "test": small.test, "unknown": small.unknown}
    for part, rows in parts.items():
        drawn = Drawn("unknown-near", part, 1)
        assert rows.attrs["seed"] == drawn.seed
        assert rows.variant.values.tolist() == drawn.pop("ship")[: rows.sizes["row"]].tolist()
        for name, values in drawn.items():
            np.testing.assert_array_equal(rows[name], values[: rows.sizes["row"]])


def test_variants_are_labelled_with_their_ship(monkeypatch):
    """Use one variant of each ship, because each must be built."""
    monkeypatch.setattr("ncti.data.splits.VARIANTS", 2)
    rows = ncti.data.splits.rows_of("variant", "test", seed=0, ships=SHIPS, count=8)
    assert {*rows.ship.values} <= {*SHIPS}
    assert all(name.startswith(("duncan@0.", "texas@0.")) for name in rows.variant.values)


@pytest.mark.parametrize("number", [0, 3])
def test_view_moments_equal_row_means_at_same_place(number, monkeypatch):
    """Means agree within the rounding of float32."""
    place = spread_place(number)
    monkeypatch.setattr(
        ncti.data.views, "range_extent", lambda *a, shift, **k: range_extent(*a, shift=place, **k)
    )
    rows = ncti.data.splits.rows_of("few-frames", "train", seed=0, ships=SHIPS, count=24)
    of_views = ncti.data.moments(rows, places=number + 1)
    which = np.searchsorted(of_views.view.values, rows.view.values)
    means = of_views["mean"].values[which, number]
    np.testing.assert_allclose(means, rows.expected, rtol=2.0**-22)
    np.testing.assert_array_equal(of_views.ship.values[which], rows.ship.values)
    np.testing.assert_array_equal(of_views.aspect.values[which], rows.aspect.values)


def test_the_card_has_the_version_and_the_date_of_the_citation(small):
    card = ncti.data.card(small)
    cited = yaml.safe_load(Path(__file__).parents[2].joinpath("CITATION.cff").read_text())
    assert card["version"] == cited["version"]
    assert card["datePublished"] == str(cited["date-released"])


def test_the_card_describes_the_files(small, tmp_path):
    ncti.data.save(small, tmp_path)
    card = json.loads((tmp_path / "croissant.json").read_text())
    assert card == ncti.data.card(small)
    for name, records in zip(("train", "test", "unknown"), card["recordSet"], strict=True):
        lines = (tmp_path / f"{name}.jsonl").read_text().splitlines()
        rows = getattr(small, name)
        assert len(lines) == rows.sizes["row"]
        assert {field["name"] for field in records["field"]} == {*json.loads(lines[0])}
        for line, row in zip(map(json.loads, lines), range(len(lines)), strict=True):
            profile = np.array(line["profile"], dtype=np.float32)
            np.testing.assert_array_equal(profile, rows.profile[row])
            assert line["ship"] == rows.ship[row] and line["aspect"] == rows.aspect[row]


def test_the_card_is_valid(small, tmp_path):
    croissant = pytest.importorskip("mlcroissant", reason="mlcroissant is not installed")
    ncti.data.save(small, tmp_path)
    read = croissant.Dataset(jsonld=tmp_path / "croissant.json")
    assert not read.metadata.ctx.issues.errors
    records = list(read.records(record_set="unknown"))
    assert [record["unknown/aspect"] for record in records] == small.unknown.aspect.values.tolist()
    np.testing.assert_allclose(records[0]["unknown/profile"], small.unknown.profile[0], rtol=1e-6)
