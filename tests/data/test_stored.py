"""Classifiers trained on a store's vectors repeat the answers that the sweep stored."""

import numpy as np
import pytest
from commands import opened, swept

import ncti
from ncti.classify import AdaptiveClusteringNetwork, CorrelationNeighbour
from ncti.data.torch import StoredRows

SHIPS, ASPECTS, LEARNED = ["duncan", "spruance", "texas"], [0, 20, 45, 70, 90], [0, 45, 90]
UNKNOWN = "texas"
PULSES, FRAMES = [30.0, 50.0], [2, 8]
SPLITS = ("learned", "test", "unknown")


@pytest.fixture(scope="module")
def store(tmp_path_factory, cache):
    path = tmp_path_factory.mktemp("stored") / "s.zarr"
    swept(
        path,
        cache,
        *(f"grid.ship={SHIPS}", f"grid.aspect={ASPECTS}", f"grid.pulse_width={PULSES}"),
        *(f"grid.frame_count={FRAMES}", "grid.replicate=2", "sensor=both", "grid.range=50"),
        *(f"classifier.training_aspect={LEARNED}", f"classifier.unknown=[{UNKNOWN}]"),
        *("classifier.name=[acn,correlation,likelihood]", "infrared.subpixel_offsets=2"),
        *("infrared.super_resolution=[none,perfect]", "infrared.orders=1"),
    )
    return path


def answers(store, classifier, split, **where):
    """Return the names that a sweep gave to the views of a split, ship by ship."""
    stored = opened(store, f"classification/{classifier}").sel(where)
    known = np.array([ship != UNKNOWN for ship in SHIPS])
    learned = np.isin(ASPECTS, LEARNED)
    ships = ~known if split == "unknown" else known
    aspects = {"test": ~learned, "learned": learned, "unknown": learned | True}[split]
    cells = stored.predicted.isel(ship=ships, aspect=aspects).squeeze()
    cells = cells.transpose("ship", "aspect", ...) if "ship" in cells.dims else cells
    return stored.ship.values[cells.values.astype(int).reshape(-1)].tolist()


PLACES = {
    "correlation": {"pulse_width": 50.0, "frame_count": 8, "replicate": 1},
    "acn": {"pulse_width": 30.0, "frame_count": 2, "replicate": 0},
    "acn_infrared": {"super_resolution": "perfect", "frame_count": 8, "phase": 1},
}


@pytest.mark.parametrize("split", SPLITS)
@pytest.mark.parametrize("name", PLACES)
def test_refitted_classifier_reproduces_stored_answers(store, name, split):
    """Test profiles, and silhouettes at one place on the pixels."""
    where = PLACES[name]
    classifier = CorrelationNeighbour()
    if name != "correlation":
        stored = opened(store, f"classification/{name}")
        classifier = AdaptiveClusteringNetwork(vigilance=float(stored.vigilance.values.item()))
    classifier.fit(*ncti.load_xy(store, name, **where)[:2])
    X, *_ = ncti.load_xy(store, name, split, **where)
    assert classifier.predict(X).tolist() == answers(store, name, split, **where)


def test_stored_rows_accept_lists_of_values(store):
    where = {"split": "learned", "pulse_width": 30.0, "frame_count": FRAMES}
    X, *_ = ncti.load_xy(store, "range_profile", **where)
    rows = StoredRows(store, "range_profile", **where)
    vectors = [vector for vector, _ in rows.__getitems__(range(len(X)))]
    np.testing.assert_array_equal(vectors, X.astype(np.float32))


def test_splits_partition_all_views(store):
    """Learned views equal those of training, once per draw, pulse width and number of frames."""
    draws = 2 * len(PULSES) * len(FRAMES)
    every = {"pulse_width": PULSES, "frame_count": FRAMES}
    views = {split: ncti.load_xy(store, split=split, **every)[1:] for split in ("train", *SPLITS)}
    groups = {split: set(of_split[1].tolist()) for split, of_split in views.items()}
    assert groups["train"] == groups["learned"]
    assert sum(len(groups[split]) for split in SPLITS) == len(SHIPS) * len(ASPECTS)
    assert len(set.union(*groups.values())) == len(SHIPS) * len(ASPECTS)
    for split in SPLITS:
        y, of_row = views[split]
        assert (np.unique(of_row, return_counts=True)[1] == draws).all()
        assert set(y) == ({UNKNOWN} if split == "unknown" else {*SHIPS} - {UNKNOWN})
    assert len(views["train"][0]) == len(PULSES) * len(groups["train"])


def test_likelihood_vectors_are_the_stored_averages(store):
    averages = opened(store, "range_profile").averaged.sel(ship=UNKNOWN)
    every = {"pulse_width": PULSES, "frame_count": FRAMES}
    X, *_ = ncti.load_xy(store, "likelihood", "unknown", **every)
    averages = averages.transpose("aspect", "pulse_width", "replicate", "frame_count", "range", ...)
    assert sorted(X.tolist()) == sorted(averages.values.reshape(X.shape).tolist())


@pytest.mark.parametrize(
    ("named", "arguments"),
    [
        ("split", {"split": "validation"}),
        ("classifier_group", {"classifier_group": "nobody"}),
        ("pulse_width", {"pulse_width": 31.0}),
        ("speed", {"speed": 3.0}),
        ("range", {"range": ["far"]}),
        ("pulse_width", {"frame_count": 8}),
        ("frame_count", {"split": "learned", "pulse_width": 30.0}),
        ("super_resolution", {"classifier_group": "infrared", "split": "test"}),
    ],
)
def test_invalid_selectors_are_refused_by_name(store, named, arguments):
    with pytest.raises(ValueError, match=rf"^{named} is\b"):
        ncti.load_xy(store, **arguments)


def test_a_split_without_views_is_refused(tmp_path, cache):
    """A sweep that learns every aspect of every ship has no other view to test."""
    swept(
        tmp_path / "all.zarr",
        cache,
        *("grid.ship=duncan", "grid.aspect=[0,20]", "grid.pulse_width=30", "sensor=range"),
        *("grid.frame_count=2", "grid.range=50", "classifier.name=acn"),
    )
    for split in ("test", "unknown"):
        with pytest.raises(ValueError, match=rf"^split is '{split}'"):
            ncti.load_xy(tmp_path / "all.zarr", split=split)
    with pytest.raises(ValueError, match=r"^store is '.*none.zarr'"):
        ncti.load_xy(tmp_path / "none.zarr")
