"""Finished stages on disk, found again by the hash of what they depend on."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class StageCache:
    """A folder of arrays, one file a stage result.

    Attributes
    ----------
    folder : Path
        Where the files are kept; made when the first one is.
    """

    folder: Path

    def fetch(
        self, stage: str, version: int, inputs: Mapping[str, Any], compute: Callable[[], Arrays]
    ) -> Arrays:
        """Arrays of a stage: read back when they are there, else computed and kept.

        Parameters
        ----------
        stage : str
            Name of the stage.
        version : int
            Version of its code; raise it when its results change.
        inputs : mapping
            Everything the result depends on, as JSON values.
        compute : callable
            Makes the arrays.

        Returns
        -------
        dict of str to ndarray
            What `compute` returned, now or then. A damaged file counts as absent.
        """
        name = json.dumps([stage, version, inputs], sort_keys=True, allow_nan=False)
        digest = hashlib.sha256(name.encode()).hexdigest()
        path = self.folder / stage / digest[:2] / f"{digest[2:]}.npz"
        try:
            with np.load(path, allow_pickle=False) as kept:
                return {key: kept[key] for key in kept.files}
        except FileNotFoundError:
            pass
        except (OSError, ValueError, EOFError, zipfile.BadZipFile):
            path.unlink(missing_ok=True)
        arrays = compute()
        _write(path, arrays)
        return arrays


def _write(path: Path, arrays: Arrays) -> None:
    """Write under another name, then rename: a reader sees all of the file or none of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".partial")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
