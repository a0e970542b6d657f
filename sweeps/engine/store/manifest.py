"""The manifest of a store: the size of each object, and a digest of the sources of each chunk.

A changed chunk fails its checksum when it is read, but a missing one reads as fill values; a
listing of the store reveals it without reading. A store changes in three steps, and the writer puts
a new manifest at the start of each: first with the names of the pending chunks, which no metadata
reference yet; then with all new metadata, which it then puts in place, the root's last; and finally
for the finished store.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from sweeps.engine.cache.packs import seal, unseal
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import PathOrUrl
from sweeps.engine.objects import Objects
from sweeps.engine.store.arrays import METADATA

MANIFEST = "manifest"


@dataclass(frozen=True)
class Manifest:
    """Contents of a store, by name of an object or path of an array.

    `chunks` has the prefix of each array and, by index, the digest of a chunk's sources; a chunk
    of only fill values has no file. During a write, `pending_chunks` names the new chunks, `nodes`
    has all new metadata, and `previous_files` the sizes of all earlier objects.
    """

    files: dict[str, int] = field(default_factory=dict)
    chunks: dict[str, tuple[str, dict[str, str]]] = field(default_factory=dict)
    pending_chunks: list[str] = field(default_factory=list)
    nodes: dict[str, Any] = field(default_factory=dict)
    previous_files: dict[str, int] = field(default_factory=dict)

    def put(self, objects: Objects) -> None:
        """Write the manifest."""
        document = {name: value for name, value in asdict(self).items() if value}
        objects.put(MANIFEST, seal(document))

    @property
    def object_names(self) -> set[str]:
        """Names of all objects that sweeps wrote."""
        return {MANIFEST, *self.files, *self.pending_chunks, *self.previous_files}

    def accepts_size(self, name: str, size: int | None) -> bool:
        """Return whether an object may have a size, or be absent."""
        if self.nodes and (name in self.previous_files or name.endswith(METADATA)):
            return size in (self.files.get(name), self.previous_files.get(name))
        return name not in self.files or size == self.files[name]


def read_manifest(path: PathOrUrl) -> Manifest | None:
    """Return the manifest of a store; None if there is none.

    Raises ConfigurationError if it is damaged, and OSError if it cannot be read.
    """
    content = Objects(path).get(MANIFEST)
    if content is None:
        return None
    try:
        return Manifest(**unseal(content))
    except (ValueError, TypeError) as error:
        raise _unreadable_error(path) from error


def refuse_foreign(path: PathOrUrl, found: Iterable[str], manifest: Manifest | None) -> None:
    """Refuse a folder with objects that no sweep wrote, or without a manifest."""
    if not (foreign := sorted({*found} - (manifest or Manifest()).object_names)):
        return
    more = f" and {len(foreign) - 1:,} more" if len(foreign) > 1 else ""
    reason = f"which contains {foreign[0]!r}{more}, not part of the store; move it"
    if manifest is None:
        reason = (
            "which exists but is not a store of a sweep; give a new path or the store of a sweep"
        )
    raise ConfigurationError(f"store is {str(path)!r}, {reason}")


def require_manifest(path: PathOrUrl) -> Manifest:
    """Return the manifest of a store; ConfigurationError if it is missing or damaged."""
    manifest = read_manifest(path)
    if manifest is None:
        raise _unreadable_error(path)
    return manifest


def _unreadable_error(path: PathOrUrl) -> ConfigurationError:
    return ConfigurationError(
        f"store is {str(path)!r}, whose {MANIFEST} cannot be read; "
        "give another path, or remove it if it is a damaged store"
    )


def verify(path: PathOrUrl, groups: Iterable[str] | None = None) -> list[str]:
    """Return the sorted names of objects that are missing, of another size, or unexpected.

    Read only the manifest and a listing. An object that is not in the manifest counts as damage,
    because zarr would read it as a chunk. With `groups`, verify only their objects and all
    metadata. Raises OSError if the path cannot be read, and ConfigurationError without a manifest.
    """
    manifest, sizes = require_manifest(path), Objects(path).sizes()
    prefixes, known_names = tuple(f"{group}/" for group in groups or ()), manifest.object_names
    return sorted(
        name
        for name in {*manifest.files, *manifest.previous_files, *sizes}
        if groups is None or name.startswith(prefixes) or name.endswith(METADATA)
        if name not in known_names or not manifest.accepts_size(name, sizes.get(name))
    )
