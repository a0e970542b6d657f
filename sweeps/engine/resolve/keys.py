"""Keys of results: 128-bit hashes in arrays, two 64-bit integers for each cell."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Keys = NDArray[np.uint64]  # (..., 2)

HASH_BYTES = 16


def hash_bytes(data: str | bytes | memoryview, size: int = HASH_BYTES) -> bytes:
    """Return the hash of a text or bytes, `size` bytes long."""
    data = data.encode() if isinstance(data, str) else data
    return hashlib.blake2b(data, digest_size=size).digest()


def digest(data: str | bytes) -> str:
    """Return the hash of a text or bytes as 32 hexadecimal digits."""
    return hash_bytes(data).hex()


def hash_texts(texts: Iterable[str | bytes | memoryview]) -> Keys:
    """Return the hash of each text, (text, 2) ndarray."""
    hashes = b"".join(map(hash_bytes, texts))
    return np.frombuffer(hashes, "<u8").reshape(-1, 2).astype(np.uint64)


def fold(keys: Keys, words: Keys) -> None:
    """Mix hashes into keys, in place; the order of calls matters.

    Mix each 64-bit half of a key separately: multiply it by the increment of SplitMix64, so that
    key and hash are not interchangeable, XOR it with the same half of the hash, and apply the
    finalizer of SplitMix64 (Steele, Lea and Flood 2014, https://doi.org/10.1145/2660193.2660195).
    Each step has an inverse. Since the halves of a hash are independent, two of n keys collide with
    a probability of n^2 / 2^129.

    Parameters
    ----------
    keys : (cell, 2) ndarray
        Keys that are changed.
    words : (cell, 2) or (2,) ndarray
        Hashes that are mixed in.
    """
    keys *= np.uint64(0x9E3779B97F4A7C15)
    keys ^= words
    keys ^= keys >> np.uint64(30)
    keys *= np.uint64(0xBF58476D1CE4E5B9)
    keys ^= keys >> np.uint64(27)
    keys *= np.uint64(0x94D049BB133111EB)
    keys ^= keys >> np.uint64(31)


def unique_keys(keys: Keys) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Factorise keys: the index of each distinct key's first occurrence, and each key's number.

    Parameters
    ----------
    keys : (key, 2) ndarray
        In any order.

    Returns
    -------
    first, number : (distinct,) and (key,) ndarrays
        `keys[first][number]` equals `keys`.
    """
    order = np.argsort(keys[:, 0])
    halves = keys[order, 0]
    if (halves[1:] != halves[:-1]).all():
        indices = np.arange(len(keys), dtype=np.int32)
        return indices, indices
    del halves
    equal = keys[order[1:]] == keys[order[:-1]]
    if (equal[:, 0] & ~equal[:, 1]).any():  # equal first halves only: once in 10^19 pairs
        order = np.lexsort((keys[:, 1], keys[:, 0]))
        equal = keys[order[1:]] == keys[order[:-1]]
    is_new = np.concatenate([[True], ~equal.all(axis=1)])
    first = np.minimum.reduceat(order, np.flatnonzero(is_new))
    occurrence_order = np.argsort(first)
    rank = np.empty_like(occurrence_order)
    rank[occurrence_order] = np.arange(len(first))
    number = np.empty_like(order)
    number[order] = rank[np.cumsum(is_new) - 1]
    return first[occurrence_order].astype(np.int32), number.astype(np.int32)


def concatenate(*arrays: NDArray[Any]) -> NDArray[Any]:
    """Return arrays one after the other; the same array if all others are empty."""
    filled = [array for array in arrays if len(array)] or [arrays[0]]
    return filled[0] if len(filled) == 1 else np.concatenate(filled)


def key_text(key: Keys) -> str:
    """Return a key as text: 32 hexadecimal digits."""
    return "".join(f"{half:016x}" for half in key.tolist())
