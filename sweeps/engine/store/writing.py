"""Stores: the results of a sweep as one zarr DataTree, which appears whole or not at all.

The same input in the same order makes a byte-identical new store, without times, hosts or paths.
Metadata are consolidated: the metadata of a group include the metadata of everything below it, so
that reading one object opens a store, at the root or at any group. A store grows in place: a chunk
that metadata reference is rewritten only if it is damaged. The chunks of a changed array get new
names, and when all metadata reference these, the writer deletes the old chunks.
"""

from __future__ import annotations

import json
import logging
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import accumulate, islice
from pathlib import Path
from typing import Any

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import PathOrUrl, resolve_path
from sweeps.engine.declare.storable import decode_attrs, encode_attrs
from sweeps.engine.objects import REQUESTS, Objects, world_readable
from sweeps.engine.run.cluster import Executor
from sweeps.engine.run.interrupts import allow_interrupts, raise_if_stopped
from sweeps.engine.store.arrays import (
    CHUNK_PREFIXES,
    METADATA,
    Array,
    ArrayGroup,
    Region,
    encode,
    iter_chunks,
    metadata,
)
from sweeps.engine.store.manifest import (
    MANIFEST,
    Manifest,
    read_manifest,
    refuse_foreign,
    require_manifest,
)

LOG = logging.getLogger(__name__)
PARTIAL = "partial"
"""Attribute of a store and its groups that says how many cells are missing."""

MAX_TASK_CHUNKS = 64  # most chunks in a task of another process

Nodes = dict[str, dict[str, Any]]  # metadata by path in the store


def write_store(
    path: PathOrUrl,
    groups: Mapping[str, ArrayGroup],
    attributes: Mapping[str, Any],
    *,
    shared: tuple[str, ...] = (),
    check: Callable[[], None] = lambda: None,
    writers: Executor | None = None,
) -> None:
    """Write a store, or the changes of an existing one.

    The caller holds the lock of the store (`store_lock`), and has called `recover`. `check`, of the
    lock, is called before readers see a change; if anything fails before that, the store is
    unchanged. Readers must open the store again. Flushing is left to the operating system: `verify`
    finds files that a power cut has lost. Memory holds only a few chunks at once.

    `groups` are by path, such as 'classification/acn', without parents. `attributes` belong to the
    root; all groups repeat the ones named in `shared`. `writers` is an executor for the chunks that
    other processes can compute and write.
    """
    groups = {name: group.fold_scalars(shared) for name, group in groups.items()}
    with world_readable():
        objects, manifest = Objects(path, create=True), read_manifest(path)
        sizes, old = Objects(path).sizes(), manifest or Manifest()  # a listing makes no folder
        refuse_foreign(path, sizes, manifest)
        arrays = {
            f"{name}/{inner}": array.with_fill()
            for name, group in groups.items()
            for inner, array in group.arrays.items()
        }
        layouts = {path: _lay_out(path, array, old, sizes) for path, array in arrays.items()}
        array_metadata = {path: metadata(array, layouts[path][0]) for path, array in arrays.items()}
        nodes = _make_nodes(groups, array_metadata, attributes, shared)
        chunks = [chunk for _, array_chunks in layouts.values() for chunk in array_chunks]
        unchanged = {chunk.name: sizes.get(chunk.name) for chunk in chunks if chunk.is_stored}
        new_chunks = [chunk for chunk in chunks if not chunk.is_stored]
        new_names = [chunk.name for chunk in new_chunks]
        intent = replace(old, pending_chunks=new_names)
        try:
            intent.put(objects)
            chunk_sizes = dict(unchanged)
            if writers is not None:
                chunk_sizes |= _write_remotely(objects, new_chunks, writers)
            with allow_interrupts():
                chunk_sizes |= _write_chunks(
                    objects, [chunk for chunk in new_chunks if chunk.name not in chunk_sizes]
                )
            files = {name: size for name, size in chunk_sizes.items() if size is not None}
            # Another process may have written something there.
            refuse_foreign(path, objects.sizes(), read_manifest(path))
            check()
        except BaseException:
            with suppress(OSError):
                _roll_back(objects, intent)
            raise
        files |= {name: len(content) for name, content in _metadata_objects(nodes).items()}
        files = dict(sorted(files.items()))  # in an order that does not depend on the writers
        LOG.debug(
            "%d chunks are written, %d stay: they have equal cells", len(new_chunks), len(unchanged)
        )
        chunk_digests = {
            path: (prefix, {chunk.index: chunk.digest for chunk in array_chunks})
            for path, (prefix, array_chunks) in layouts.items()
            if array_chunks
        }
        finished = Manifest(files, chunk_digests, new_names, nodes, old.files)
        finished.put(objects)
        _commit(objects, finished, check)


def recover(path: PathOrUrl) -> None:
    """Finish or undo the change of a killed writer; the caller holds the lock of the store."""
    manifest = read_manifest(path)
    if manifest is not None and (manifest.nodes or manifest.pending_chunks):
        objects = Objects(path, create=True)
        objects.delete_unfinished()
        if manifest.nodes:
            _commit(objects, manifest, lambda: None)
        else:
            _roll_back(objects, manifest)


def _commit(objects: Objects, manifest: Manifest, check: Callable[[], None]) -> None:
    """Put all metadata in place, the root's last, and delete unreferenced objects."""
    documents = _metadata_objects(manifest.nodes)
    root = documents.pop(METADATA)
    objects.map(lambda item: objects.put(*item), documents.items())
    check()
    objects.put(METADATA, root)
    former = {*manifest.previous_files, *manifest.pending_chunks}
    objects.delete(sorted(former.difference(manifest.files)))
    replace(manifest, pending_chunks=[], nodes={}, previous_files={}).put(objects)


def _roll_back(objects: Objects, manifest: Manifest) -> None:
    """Remove the chunks of an unfinished change; everything of a new store."""
    objects.delete(name for name in manifest.pending_chunks if name not in manifest.files)
    if manifest.files:
        replace(manifest, pending_chunks=[]).put(objects)
    else:
        objects.delete([MANIFEST])
        objects.remove_empty_folders()


def read_attributes(path: PathOrUrl) -> dict[str, Any] | None:
    """Return the decoded attributes of the root of a store; None if there is none yet.

    Raises ConfigurationError if it is not a store, or its metadata are damaged.
    """
    objects, manifest = Objects(path), read_manifest(path)
    if manifest is None and not objects.sizes():
        return None
    content, manifest = objects.get(METADATA), manifest or require_manifest(path)
    if content is None and manifest.accepts_size(METADATA, None):
        return None  # its first writer did not finish
    try:
        if content is None or not manifest.accepts_size(METADATA, len(content)):
            raise ValueError("its size differs")
        return decode_attrs(json.loads(content)["attributes"])
    except ValueError as error:
        raise ConfigurationError(
            f"store is {str(path)!r}, whose {METADATA} cannot be read; "
            "give another path or remove it"
        ) from error


def zarr_store(path: PathOrUrl) -> Any:
    """Return the store of a path that zarr and xarray open, read-only."""
    from zarr.storage import LocalStore, ObjectStore

    if isinstance(path, Path):  # a thread of obstore that answers while Python ends aborts it
        return LocalStore(path, read_only=True)
    return ObjectStore(Objects(path).store, read_only=True)


# chunks -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Chunk:
    """A chunk of an array.

    `is_stored`: the store already has the chunk, made from equal cells and undamaged, or absent
    because it holds only the fill value.
    """

    name: str
    index: str
    array: Array
    region: Region
    digest: str
    is_stored: bool


def _lay_out(
    path: str, array: Array, old: Manifest, sizes: Mapping[str, int]
) -> tuple[str, list[Chunk]]:
    """Return the prefix and the chunks of an array.

    If the new chunks include all chunks of the stored array, the prefix stays the same.
    """
    chunks = [(index, region, array.digest(region)) for index, region in iter_chunks(array)]
    prefix, digests = old.chunks.get(path, (CHUNK_PREFIXES[0], {}))
    if not digests.items() <= {(index, digest) for index, _, digest in chunks}:
        prefix, digests = next(each for each in CHUNK_PREFIXES if each != prefix), {}
    names = {index: f"{path}/{prefix}{index}" for index, _, _ in chunks}
    stored = {index for index in digests if old.accepts_size(names[index], sizes.get(names[index]))}
    return prefix, [
        Chunk(names[index], index, array, region, digest, index in stored)
        for index, region, digest in chunks
    ]


def _write_chunks(objects: Objects, chunks: Sequence[Chunk]) -> dict[str, int | None]:
    """Write chunks, several at once; return their sizes by name, None for empty ones."""
    files: dict[str, int | None] = {}
    with ThreadPoolExecutor(REQUESTS) as pool:
        pending: deque[Future[None]] = deque()
        for chunk in chunks:
            content = encode(chunk.array, chunk.region)
            files[chunk.name] = None if content is None else len(content)
            if content is not None:
                pending.append(pool.submit(objects.put, chunk.name, content))
            if len(pending) > 2 * REQUESTS:
                pending.popleft().result()
        for future in pending:
            future.result()
    return files


def _write_remotely(
    objects: Objects, chunks: Sequence[Chunk], writers: Executor
) -> dict[str, int | None]:
    """Let other processes write new chunks; return the sizes of the written ones.

    The caller writes the others, such as chunks sent to workers that cannot access the store.
    """
    objects = Objects(resolve_path(objects.path))  # no worker makes the folder
    new_chunks = [chunk for chunk in chunks if chunk.array.remote_read is not None]
    size = min(MAX_TASK_CHUNKS, len(new_chunks) // (4 * writers.worker_count) + 1)
    batches = enumerate(new_chunks[k : k + size] for k in range(0, len(new_chunks), size))
    files: dict[str, int | None] = {}
    under_way = 0
    try:
        while True:
            raise_if_stopped()
            free_slots = max(0, 2 * writers.worker_count - under_way)  # workers may have left
            for number, batch in islice(batches, free_slots):
                sent = [
                    (chunk.name, chunk.array.worker_part(chunk.region), chunk.region)
                    for chunk in batch
                ]
                writers.submit(number, write_on_worker, objects, sent)
                under_way += 1
            if not under_way:
                return files
            for _, chunk_sizes, _ in writers.wait():
                under_way -= 1
                files |= chunk_sizes or {}
    except BaseException:
        with suppress(Exception):  # the writers may be gone
            while under_way and (finished := writers.wait()):  # nothing is written after that
                under_way -= len(finished)
        raise


def write_on_worker(
    objects: Objects, chunks: Sequence[tuple[str, Array, Region]]
) -> dict[str, int | None]:
    """Write chunks that the manifest announces; return their sizes by name, None for empty ones.

    Skips the rest once the manifest changes: the command that announced the chunks has then ended.
    """
    files: dict[str, int | None] = {}
    version, manifest = objects.head(MANIFEST), read_manifest(objects.path)
    announced = set(manifest.pending_chunks if manifest else ())
    with world_readable():
        for name, array, region in chunks:
            content = encode(array, region)
            if name in announced and objects.head(MANIFEST) == version:
                if content is not None:
                    objects.put(name, content)
                files[name] = None if content is None else len(content)
    return files


# metadata -----------------------------------------------------------------------------------------


def _make_nodes(
    groups: Mapping[str, ArrayGroup],
    arrays: Mapping[str, dict[str, Any]],
    attributes: Mapping[str, Any],
    shared: tuple[str, ...],
) -> Nodes:
    """Return the metadata of the root, groups and arrays by path; the root's path is empty."""
    repeated = encode_attrs({name: attributes[name] for name in shared})
    nodes = {"": _group_node(encode_attrs(attributes))}
    for name, group in groups.items():
        for parent in accumulate(name.split("/"), "{}/{}".format):
            nodes.setdefault(parent, _group_node(repeated))
        nodes[name] = _group_node({**repeated, **group.attributes})
    for path, array in arrays.items():
        if path in nodes:
            raise ValueError(f"{path!r} is a group and an array")
        nodes[path] = array
    return nodes


def _group_node(
    attributes: Mapping[str, Any], descendants: Mapping[str, Any] = {}
) -> dict[str, Any]:
    return {
        "attributes": dict(attributes),
        "zarr_format": 3,
        "consolidated_metadata": {
            "kind": "inline",
            "must_understand": False,
            "metadata": dict(descendants),
        },
        "node_type": "group",
    }


def _metadata_objects(nodes: Nodes) -> dict[str, bytes]:
    """Return the objects of the metadata of all nodes, by name."""
    # zarr reads the children of a group only if they follow each other.
    ordered = sorted(nodes, key=lambda name: (name.count("/"), name.rpartition("/")[0]))
    documents: dict[str, bytes] = {}
    for name, node in nodes.items():
        prefix = f"{name}/" if name else ""
        if node["node_type"] == "group":
            descendants = [path for path in ordered if path.startswith(prefix) and path]
            relative = {path.removeprefix(prefix): nodes[path] for path in descendants}
            node = _group_node(node["attributes"], relative)
        documents[f"{prefix}{METADATA}"] = json.dumps(node, separators=(",", ":")).encode()
    return documents
