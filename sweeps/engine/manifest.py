"""The manifest of a store: a checksum of every file, so that damage is noticed.

A checksum within each chunk tells a changed chunk, but neither a missing one, which zarr reads as
fill values, nor changed metadata.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.sealed import seal, unseal

MANIFEST = "manifest"


def write_file(file: Path, content: bytes) -> int:
    """Write a file, with any folders that it needs, and return its checksum."""
    try:
        file.write_bytes(content)
    except FileNotFoundError:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    return zlib.crc32(content)


def write_manifest(path: Path, known: Mapping[str, int]) -> None:
    """Write the manifest of a store, given the checksums that are known from writing files."""
    names = sorted(_names(path))
    files = {name: known[name] if name in known else _checksum(path / name) for name in names}
    write_file(path / MANIFEST, seal(files))


def read_manifest(path: Path) -> dict[str, int]:
    """Checksum of every file of a store, by name relative to it.

    Raises
    ------
    ConfigurationError
        If there is no manifest, or a damaged one.
    """
    try:
        files: dict[str, int] = unseal((path / MANIFEST).read_bytes())
    except (OSError, ValueError) as error:
        raise ConfigurationError(
            f"store is {str(path)!r}, whose {MANIFEST} cannot be read; "
            "give another path, or remove it if it is a damaged store"
        ) from error
    return files


def verify(path: Path) -> list[str]:
    """Sorted names of files of a store that are missing, changed or not of it.

    A file that is not in the manifest counts as damage, because zarr would read it as a chunk.

    Raises
    ------
    ConfigurationError
        If the store has no readable manifest.
    """
    files = read_manifest(path)
    damaged = set(_names(path)) - set(files)
    for name, checksum in files.items():
        try:
            if _checksum(path / name) != checksum:
                damaged.add(name)
        except OSError:
            damaged.add(name)
    return sorted(damaged)


def _names(path: Path) -> Iterator[str]:
    for folder, _, files in os.walk(path):
        for file in files:
            name = f"{folder}/{file}"[len(str(path)) + 1 :]
            if name != MANIFEST:
                yield name


def _checksum(file: Path) -> int:
    return zlib.crc32(file.read_bytes())
