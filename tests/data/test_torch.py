"""PyTorch data sets give each row of `load_xy` once per epoch, for any number of workers."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
from commands import swept

import ncti
import ncti.data.torch
from ncti.data.torch import RowStream, StoredRows

ROWS, PIECES, BATCH = 12, 3, 5
GIVEN = (
    *("sensor=dataset", "grid.ship=[duncan,texas]", "grid.range=100", "grid.pulse_width=30"),
    *("grid.frame_count=1", "dataset.rows_per_view=2"),
    *(f"dataset.rows={ROWS}", f"dataset.pieces={PIECES}"),
)


@pytest.fixture(scope="module")
def store(tmp_path_factory, cache):
    path = tmp_path_factory.mktemp("torch") / "rows.zarr"
    swept(path, cache, *GIVEN)
    return path


@pytest.fixture(scope="module")
def rows(store):
    return StoredRows(store)


class Worker:
    """Stand-in for the result of `torch.utils.data.get_worker_info`."""

    def __init__(self, number, workers):
        self.id, self.num_workers = number, workers


def loaded(stream, workers, monkeypatch):
    """Return batches as a loader takes them from its workers in turn, until all are exhausted."""
    by_worker = []
    for number in range(workers):
        worker = Worker(number, workers)
        monkeypatch.setattr(ncti.data.torch, "get_worker_info", lambda worker=worker: worker)
        by_worker.append([*pickle.loads(pickle.dumps(stream))])
    return [
        batches[turn]
        for turn in range(len(by_worker[0]))
        for batches in by_worker
        if turn < len(batches)
    ]


def test_indexed_rows_equal_load_xy(store, rows):
    X, y, _ = ncti.load_xy(store)
    assert len(rows) == len(X) == ROWS * PIECES
    for index in (0, ROWS - 1, ROWS, len(X) - 1, -1):
        vector, label = rows[index]
        np.testing.assert_array_equal(vector, X[index].astype(np.float32))
        assert rows.classes[label] == y[index]
    numbers = [30, 2, 2, 17]  # out of order, one of them twice
    for index, (vector, label) in zip(numbers, rows.__getitems__(numbers), strict=True):
        np.testing.assert_array_equal(vector, X[index].astype(np.float32))
        assert rows.classes[label] == y[index]
    for beyond in (len(X), -len(X) - 1):
        with pytest.raises(IndexError):
            rows[beyond]
    assert [label for _, label in rows] == [rows.classes.index(name) for name in y]


@pytest.mark.parametrize("workers", [1, 2, 3, 8])
def test_batches_have_each_row_once_in_seeded_order(rows, workers, monkeypatch):
    """The order is the same for any number of workers, and differs by seed and epoch."""

    def batches(seed, epoch, workers):
        stream = RowStream(rows, batch_size=BATCH, seed=seed)
        stream.set_epoch(epoch)
        return loaded(stream, workers, monkeypatch)

    single, together = batches(4, 0, 1), batches(4, 0, workers)
    for first, second in zip(single, together, strict=True):
        for ours, theirs in zip(first, second, strict=True):
            np.testing.assert_array_equal(ours, theirs)
    vectors = np.concatenate([X for X, _ in together])
    of_rows = np.stack([vector for vector, _ in rows])
    np.testing.assert_array_equal(np.unique(vectors, axis=0), np.unique(of_rows, axis=0))
    assert len(vectors) == len(rows)
    orders = [batches(*which, workers) for which in ((4, 0), (4, 1), (5, 0))]
    for first, second in pairwise(orders):
        assert any(
            not np.array_equal(a[1], b[1]) for a, b in zip(first, second, strict=True)
        ) or any(not np.array_equal(a[0], b[0]) for a, b in zip(first, second, strict=True))


class Pieces:
    """Rows of sixteen pieces that record the pieces read."""

    sizes = dict.fromkeys(range(16), 20)

    def __init__(self):
        self.read = set()

    def piece(self, number):
        self.read.add(number)
        return np.full((20, 1), float(number)), np.zeros(20, dtype=np.int64)


@pytest.mark.parametrize("workers", [2, 4, 8])
def test_no_two_workers_read_the_same_piece(workers, monkeypatch):
    read = []
    for number in range(workers):
        worker = Worker(number, workers)
        monkeypatch.setattr(ncti.data.torch, "get_worker_info", lambda worker=worker: worker)
        pieces = Pieces()
        assert len([*RowStream(pieces, batch_size=7, seed=0)]) == 16 * 3 // workers
        read += sorted(pieces.read)
    assert sorted(read) == [*range(16)]


def test_labels_index_the_given_classes(store):
    rows = StoredRows(store, classes=["roberts", "texas", "duncan"])
    assert {rows.classes[label] for _, label in rows} == {"texas", "duncan"}
    with pytest.raises(ValueError, match=r"^classes is .*must have texas"):
        StoredRows(store, classes=["duncan"])[0]


def test_torch_data_loader_reads_the_same_rows(store, rows):
    data = pytest.importorskip("torch.utils.data")
    X, y, _ = ncti.load_xy(store)
    batches = data.DataLoader(rows, batch_size=BATCH, num_workers=2)
    vectors, labels = zip(*batches, strict=True)
    np.testing.assert_array_equal(np.concatenate(vectors), X.astype(np.float32))
    assert [rows.classes[label] for label in np.concatenate(labels)] == y.tolist()
    stream = RowStream(rows, batch_size=BATCH, seed=4)
    for workers in (0, 2, 3):
        loader = data.DataLoader(stream, batch_size=None, num_workers=workers)
        for ours, theirs in zip(stream, loader, strict=True):
            for array, expected in zip(ours, theirs, strict=True):
                np.testing.assert_array_equal(array, expected)
