"""Splits: no view, draw or variant of a test is in training, by the parameters of all of them."""

import json

import numpy as np
import pytest

import ncti
from ncti.data.splits import CNR_LOSS, SISTER, STRANGER, gap, trained_as

SIZES = {"train": 64, "test": 16, "ships": ("duncan", "texas")}
SEEDS = (0, 1, 12345)


@pytest.fixture(scope="module", params=SEEDS)
def splits(request):
    several = ncti.data.SPLITS
    return {name: ncti.data.split(name, seed=request.param, **SIZES) for name in several}


def parts_tested(of):
    return [of.test] if of.unknown is None else [of.test, of.unknown]


def views_of(rows):
    """Views as the rendering sees them: an aspect of the other side is that of its mirror image."""
    aspect = np.minimum(rows.aspect.values % 360, -rows.aspect.values % 360)
    return {*zip(rows.variant.values, aspect.tolist(), rows.depression.values, strict=True)}


def draws_of(rows):
    """Streams of noise: the seed of the data set and the number of the row key each."""
    return {(rows.attrs["seed"], row) for row in rows.row.values.tolist()}


def test_no_test_has_a_view_or_a_draw_of_its_training(splits):
    for name, of in splits.items():
        for tested in parts_tested(of):
            assert not views_of(of.train) & views_of(tested), name
            assert not draws_of(of.train) & draws_of(tested), name
            assert len(draws_of(tested)) == tested.sizes["row"]


def test_no_training_of_any_split_has_a_view_or_a_draw_of_the_test_of_another(splits):
    for one in splits.values():
        for other in splits.values():
            for tested in parts_tested(other):
                assert not views_of(one.train) & views_of(tested)
                assert not draws_of(one.train) & draws_of(tested)


def test_seeds_have_no_view_and_no_draw_in_common():
    one, other = (ncti.data.split("aspect-random", seed=seed, **SIZES) for seed in (0, 1))
    parts = [one.train, one.test, other.train, other.test]
    for what in (views_of, draws_of):
        assert sum(len(what(rows)) for rows in parts) == len(set().union(*map(what, parts)))


def test_variants_are_learned_or_tested_but_not_both(splits):
    of = splits["variant"]
    learned, tested = ({*rows.variant.values.tolist()} for rows in (of.train, of.test))
    assert not learned & tested
    assert {*of.train.ship.values} | {*of.test.ship.values} <= {*SIZES["ships"]}
    assert all("@" in name for name in learned | tested)


def test_each_split_differs_from_training_in_what_it_asks(splits):
    low, high = gap(splits["aspect-gap"].seed)
    sector = splits["aspect-gap"]
    assert high - low == 30.0
    assert ((sector.test.aspect >= low) & (sector.test.aspect < high)).all()
    assert not ((sector.train.aspect >= low) & (sector.train.aspect < high)).any()
    near = splits["range-shift"]
    assert {*near.train.slant_range.values} == {25e3} and {*near.test.slant_range.values} == {100e3}
    shift = splits["sensor-shift"]
    assert float(shift.train.cnr[0] - shift.test.cnr[0]) == pytest.approx(CNR_LOSS)
    assert (shift.train.gain == 1).all() and (shift.train.floor == 0).all()
    assert len(np.unique(shift.test.gain)) == len(np.unique(shift.test.floor)) == 16
    few = splits["few-frames"]
    assert {*few.train.frames.values} == {16} and {*few.test.frames.values} == {2}
    for name, unknown in (("unknown-near", SISTER), ("unknown-far", STRANGER)):
        assert {*splits[name].unknown.ship.values} == {unknown}
        assert unknown not in splits[name].train.ship.values


def test_splits_of_one_training_have_the_same_rows(splits):
    for name, of in splits.items():
        assert of.train.identical(splits[trained_as(name)].train)
    # What is tested at random aspects has the same views.
    shift = splits["sensor-shift"].test
    np.testing.assert_array_equal(shift.aspect, splits["aspect-random"].test.aspect)


def test_fewer_rows_are_the_first_of_more():
    large = ncti.data.split("unknown-far", seed=3, **SIZES)
    small = ncti.data.split("unknown-far", seed=3, **SIZES | {"train": 16, "test": 8})
    assert small.train.identical(large.train.isel(row=slice(16)))
    assert small.unknown.identical(large.unknown.isel(row=slice(4)))


def test_the_moments_of_views_are_those_of_their_rows():
    """Their mean to the rounding of float32."""
    rows = ncti.data.split("range-shift", seed=2, train=32, test=2).train
    of_views = ncti.data.moments(rows)
    which = np.searchsorted(of_views.view.values, rows.view.values)
    np.testing.assert_allclose(of_views["mean"].values[which], rows.expected, rtol=2.0**-22)
    np.testing.assert_array_equal(of_views.ship.values[which], rows.ship.values)
    np.testing.assert_array_equal(of_views.aspect.values[which], rows.aspect.values)


def test_the_card_describes_the_files(tmp_path):
    of = ncti.data.split("unknown-near", seed=1, train=16, test=4)
    ncti.data.save(of, tmp_path)
    about = json.loads((tmp_path / "croissant.json").read_text())
    assert about == ncti.data.card(of)
    for name, records in zip(("train", "test", "unknown"), about["recordSet"], strict=True):
        lines = (tmp_path / f"{name}.jsonl").read_text().splitlines()
        rows = getattr(of, name)
        assert len(lines) == rows.sizes["row"]
        assert {field["name"] for field in records["field"]} == {*json.loads(lines[0])}
        for line, row in zip(map(json.loads, lines), range(len(lines)), strict=True):
            kept = np.array(line["profile"], dtype=np.float32)
            np.testing.assert_array_equal(kept, rows.profile[row])
            assert line["ship"] == rows.ship[row] and line["aspect"] == rows.aspect[row]


def test_the_card_is_valid(tmp_path):
    croissant = pytest.importorskip("mlcroissant", reason="mlcroissant is not installed")
    of = ncti.data.split("unknown-near", seed=1, train=16, test=4)
    ncti.data.save(of, tmp_path)
    read = croissant.Dataset(jsonld=tmp_path / "croissant.json")
    assert not read.metadata.ctx.issues.errors
    records = list(read.records(record_set="unknown"))
    assert [record["unknown/aspect"] for record in records] == of.unknown.aspect.values.tolist()
    np.testing.assert_allclose(records[0]["unknown/profile"], of.unknown.profile[0], rtol=1e-6)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"name": "aspect"}, "name.*'aspect'.*aspect-random"),
        ({"seed": -1}, "seed.*-1"),
        ({"ships": ["duncan", "roberts"]}, "ships.*roberts.*connole"),
        ({"ships": ["duncan"]}, "ships.*duncan.*two"),
        ({"ships": "duncan"}, "ships.*duncan.*two"),
        ({"train": 0}, "count.*0"),
    ],
)
def test_wrong_splits_are_refused(wrong, words):
    good = {"name": "unknown-far", "seed": 0, "train": 8, "test": 2}
    with pytest.raises(ValueError, match=words):
        ncti.data.split(**(good | wrong))
