"""PyTorch data sets of a sweep's store: by row, and as a stream of batches.

They need the extra ``torch`` only for `torch.utils.data.DataLoader`: a row is a numpy vector and
the index of its ship.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import accumulate
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.data.stored import count_rows, has_rows, list_ships, load_xy

try:
    from torch.utils.data import IterableDataset, get_worker_info
except ImportError:  # the classes also serve a user's own loop
    IterableDataset = object

    def get_worker_info() -> None:
        """Return None, as outside of a loader's worker."""


Row = tuple[NDArray[np.float32], int]
Batch = tuple[NDArray[np.float32], NDArray[np.int64]]

INTERLEAVED_PIECES = 8
"""Pieces of a store that a stream interleaves."""

WHOLE_STORE = -1
"""Number that stands for a whole store without pieces."""


class StoredRows:
    """Rows of a store, a map-style data set for `torch.utils.data.DataLoader`.

    Arguments are as of `ncti.load_xy`; `classes` are names of ships by label, by default the
    store's; `sizes` has the number of rows of each piece. It reads a piece on the first access to
    one of its rows, caches the last ones, and reads the rows of a batch piece by piece.
    ``DataLoader(StoredRows("rows.zarr"), batch_size=256, shuffle=True, num_workers=2)`` gives
    batches of (row, feature) and (row,) tensors.
    """

    def __init__(
        self,
        store: str | Path,
        classifier_group: str | None = None,
        split: str = "train",
        *,
        classes: Sequence[str] | None = None,
        **where: Any,
    ) -> None:
        # Hashable key of the piece cache. The UUID keeps this object's pieces apart, since the
        # store may have grown since another object read it.
        items = tuple((k, tuple(v) if isinstance(v, list) else v) for k, v in where.items())
        self.store, self._selection = str(store), (classifier_group, split, items, uuid4().hex)
        pieces = count_rows(store) if has_rows(store) else {}
        self.classes = tuple(list_ships(store) if classes is None else classes)
        if not pieces:
            pieces = {WHOLE_STORE: len(self.piece(WHOLE_STORE)[1])}
        self.sizes = pieces
        self._ends = list(accumulate(pieces.values()))

    def __len__(self) -> int:
        return self._ends[-1]

    def __getitem__(self, index: int) -> Row:
        return self.__getitems__([index])[0]

    def __getitems__(self, indices: Sequence[int]) -> list[Row]:
        """Return rows by their indices, reading each piece once."""
        rows: dict[int, Row] = {}
        for index in sorted(set(indices)):
            if not -len(self) <= index < len(self):
                raise IndexError(f"row {index} of {len(self)}")
            position = index % len(self)
            k = bisect_right(self._ends, position)
            X, y = self.piece([*self.sizes][k])
            place = position - (self._ends[k - 1] if k else 0)
            rows[index] = X[place], int(y[place])
        return [rows[index] for index in indices]

    def piece(self, number: int) -> Batch:
        """Return the vectors and labels of one piece."""
        return _read_piece(self.store, self._selection, self.classes, number)


class RowStream(IterableDataset):
    """Batches of a store's rows in a seeded order, an iterable data set for `DataLoader`.

    Each epoch, `set_epoch`, shuffles pieces, and the rows of a piece. A batch has rows of one
    piece; batches of eight pieces alternate, and the last batch of a piece may have fewer than
    `batch_size` rows. The workers of a loader yield batches in turn, so that their number does not
    change the order; 2, 4 or 8 workers each read their own pieces, if these have equally many rows.
    ``DataLoader(RowStream(rows, batch_size=256, seed=0), batch_size=None, num_workers=2)`` gives
    batches of (row, feature) and (row,) tensors.
    """

    def __init__(self, rows: StoredRows, *, batch_size: int, seed: int) -> None:
        require("batch_size", batch_size, whole=True, minimum=1)
        require("seed", seed, whole=True, minimum=0, maximum=2**63)
        self.rows, self.batch_size, self.seed, self.epoch = rows, int(batch_size), int(seed), 0

    def set_epoch(self, epoch: int) -> None:
        """Set the epoch, which determines the order of the next iteration."""
        require("epoch", epoch, whole=True, minimum=0)
        self.epoch = int(epoch)

    def __iter__(self) -> Iterator[Batch]:
        worker = get_worker_info()
        worker_id, workers = (worker.id, worker.num_workers) if worker is not None else (0, 1)
        number = 0
        shuffled = self._rng().permutation([*self.rows.sizes]).tolist()
        for first in range(0, len(shuffled), INTERLEAVED_PIECES):
            orders = {
                piece: self._rng(piece).permutation(self.rows.sizes[piece])
                for piece in shuffled[first : first + INTERLEAVED_PIECES]
            }
            for start in range(0, max(map(len, orders.values())), self.batch_size):
                for piece, order in orders.items():
                    batch = order[start : start + self.batch_size]
                    if not batch.size:
                        continue
                    if number % workers == worker_id:
                        X, y = self.rows.piece(piece)
                        yield X[batch], y[batch]
                    number += 1

    def _rng(self, *piece: int) -> np.random.Generator:
        """Return the generator of the order of pieces, or of the rows of one piece."""
        key = (self.epoch, *(k + 1 for k in piece))
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))


@lru_cache(maxsize=INTERLEAVED_PIECES)
def _read_piece(
    store: str, selection: tuple[Any, ...], classes: tuple[str, ...], number: int
) -> Batch:
    """Return vectors and labels of a piece of a store, or of a store without pieces."""
    classifier, split, items, _ = selection
    where = {name: list(value) if isinstance(value, tuple) else value for name, value in items}
    piece = {} if number == WHOLE_STORE else {"piece": number}
    X, y, _ = load_xy(store, classifier, split, **{**where, **piece})
    if unknown := sorted(set(y.tolist()) - set(classes)):
        raise ValueError(f"classes is {classes!r:.60}, but must have {unknown[0]}")
    labels = {name: k for k, name in enumerate(classes)}
    return X.astype(np.float32), np.array([labels[name] for name in y.tolist()], dtype=np.int64)
