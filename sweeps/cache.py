"""Finished stages on disk, found again by the hash of what they depend on."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

LIBRARIES = ("embreex", "numpy", "PyOpenGL", "pyrender", "scipy", "trimesh")
SOURCES = {".py", ".vert", ".frag"}

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

    def fetch(self, stage: str, inputs: Mapping[str, Any], compute: Callable[[], Arrays]) -> Arrays:
        """Arrays of a stage: read back when they are there, else computed and kept.

        Parameters
        ----------
        stage : str
            Name of the stage.
        inputs : mapping
            Everything the result depends on, its code among it, as JSON values.
        compute : callable
            Makes the arrays.

        Returns
        -------
        dict of str to ndarray
            What `compute` returned, now or then. A damaged file counts as absent.
        """
        name = json.dumps([stage, inputs], sort_keys=True, allow_nan=False)
        digest = hashlib.sha256(name.encode()).hexdigest()
        path = self.folder / stage / digest[:2] / f"{digest[2:]}.npz"
        try:
            with np.load(path, allow_pickle=False) as kept:
                return {key: kept[key] for key in kept.files}
        except Exception:  # absent, or damaged in one of the many ways that a zip file can be
            pass
        arrays = compute()
        _write(path, arrays)
        return arrays


@lru_cache
def code_digest(*modules: str) -> str:
    """Hash of the source of modules and packages, and of the libraries behind their last bits.

    A stage that is keyed by it is made anew after any change of its code; nobody has to remember
    to say so.
    """
    libraries = {name: version(name) for name in LIBRARIES}
    parts = [json.dumps(libraries, sort_keys=True).encode()]
    for module in modules:
        spec = find_spec(module)
        if spec is None or spec.origin is None:
            raise ValueError(f"{module} is no module with a source")
        path = Path(spec.origin)
        sources = [path] if path.name != "__init__.py" else sorted(path.parent.rglob("*"))
        for source in (source for source in sources if source.suffix in SOURCES):
            parts += [str(source.relative_to(path.parent)).encode(), source.read_bytes()]
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()


def _write(path: Path, arrays: Arrays) -> None:
    """Write under another name, then rename: a reader sees all of the file or none of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".partial")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
