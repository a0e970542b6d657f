"""Cache of built ships on disk: one file a digest, written atomically."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np

from ncti.ships.build import Ship


def read(path: Path) -> Ship | None:
    """Return the ship in a file, bit for bit as written; None if it is absent or damaged."""
    try:
        with np.load(path, allow_pickle=False) as file:  # which compares checksums
            return Ship(file["vertices"], file["faces"], float(file["loa"]), float(file["beam"]))
    except Exception:  # a damaged file may raise anything
        return None


def write(path: Path, ship: Ship) -> None:
    """Write a ship to a file atomically; processes may write the same file at once.

    Failing to write is no error: the ship is built again next time. New folders are private to this
    user.
    """
    try:
        for folder in reversed(path.parents):
            if not folder.is_dir():
                folder.mkdir(mode=0o700, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(
                    file, vertices=ship.vertices, faces=ship.faces, loa=ship.loa, beam=ship.beam
                )
            os.replace(temporary, path)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError:
        return
