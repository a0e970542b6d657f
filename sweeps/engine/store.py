"""Stores: the results of a sweep as one zarr DataTree, written whole or not at all, and read back.

Equal input, given in the same order, makes equal bytes: a store holds no times, hosts or paths.
The metadata of a group repeat those of all below it ("consolidated"), so that a store opens by one
file, at the root or at any group.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from sweeps.engine.attributes import nested, plain
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.folders import (
    OPEN,
    PARTIAL,
    Remove,
    check_target,
    hidden,
    put_in_place,
    read_manifest,
    real_place,
    remove_folder,
    write_file,
    write_manifest,
)
from sweeps.engine.interrupts import interruptible
from sweeps.engine.packs import make_folder
from sweeps.engine.zarr_array import METADATA, Array, Group, Region, encode, metadata, regions

RAGGED = "ragged"  # file with the extents of a group's ragged arrays, ignored by zarr

Nodes = dict[str, dict[str, Any]]  # metadata by path in the store


def write_store(
    path: Path,
    groups: Mapping[str, Group],
    attributes: Mapping[str, Any],
    *,
    everywhere: tuple[str, ...] = (),
    threads: int = 1,
    remove: Remove = remove_folder,
) -> None:
    """Write a store and move it to its place whole, replacing an older store.

    Hold its lock meanwhile (`locked`). Memory holds a few chunks a thread. If anything fails, the
    place is unchanged. Readers of the old store must open it again. Files are left to the
    operating system to flush: `verify` finds damage of a power cut. `groups` are by path, as
    'classification/acn'; parents need not be given. `attributes` are those of the root, of which
    all groups repeat those named `everywhere`. `remove` is called with the folder of an older or
    unfinished store.
    """
    check_target(path)
    place = real_place(path)
    make_folder(place.parent, OPEN)
    partial = hidden(place, PARTIAL)
    try:
        known = _write_groups(partial, attributes, everywhere, groups, threads)
        write_manifest(partial, known)
        check_target(path)  # another process may have written something there
        put_in_place(partial, place)
    finally:
        if partial.exists():
            remove(partial)


def read_attributes(path: Path) -> dict[str, Any] | None:
    """Return attributes of the root of a store, nested ones as such; None if there is nothing.

    Raises ConfigurationError if it is not a store, or its metadata are damaged.
    """
    if not path.exists():
        return None
    checksum = read_manifest(path).get(METADATA)
    try:
        content = (path / METADATA).read_bytes()
        if zlib.crc32(content) != checksum:
            raise ValueError("its checksum differs")
        return nested(json.loads(content)["attributes"])
    except (OSError, ValueError) as error:
        raise ConfigurationError(
            f"store is {str(path)!r}, whose {METADATA} cannot be read; "
            "give another path or remove it"
        ) from error


def _write_groups(
    path: Path,
    attributes: Mapping[str, Any],
    everywhere: tuple[str, ...],
    groups: Mapping[str, Group],
    threads: int,
) -> dict[str, int]:
    """Write groups into a new store; return checksums of all files."""
    nodes: Nodes = {}
    arrays: dict[str, Array] = {}
    shared = plain({name: attributes[name] for name in everywhere})
    for name, group in groups.items():
        parts = name.split("/")
        for depth in range(1, len(parts)):
            nodes.setdefault("/".join(parts[:depth]), _group_node(shared))
        nodes[name] = _group_node({**shared, **group.attributes})
        for inner, array in (*group.arrays.items(), *group.coordinates.items()):
            if f"{name}/{inner}" in nodes:
                raise ValueError(f"'{name}/{inner}' is given twice")
            nodes[f"{name}/{inner}"] = metadata(array)
            arrays[f"{name}/{inner}"] = array
    written = _write_metadata(path, nodes, attributes)
    for name, group in groups.items():
        if group.ragged:
            file = f"{name}/{RAGGED}"
            written[file] = write_file(path / file, json.dumps(group.ragged).encode())

    def write(job: tuple[str, Array, str, Region]) -> tuple[str, int | None]:
        name, array, chunk, region = job
        content = encode(array, region)
        file = f"{name}/{chunk}"
        return file, None if content is None else write_file(path / file, content)

    with ThreadPoolExecutor(threads) as pool:
        jobs = ((name, array, *chunk) for name, array in arrays.items() for chunk in regions(array))
        chunks = pool.map(write, jobs)
        try:
            with interruptible():
                done = dict(chunks)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return written | {name: checksum for name, checksum in done.items() if checksum is not None}


def _write_metadata(path: Path, nodes: Nodes, attributes: Mapping[str, Any]) -> dict[str, int]:
    """Write the metadata of arrays, groups and root; return checksums of the files."""
    # zarr reads the children of a group only if they follow each other.
    ordered = sorted(nodes, key=lambda name: (name.count("/"), name.rpartition("/")[0]))
    written: dict[str, int] = {}
    for name, node in {"": _group_node(plain(attributes)), **nodes}.items():
        prefix = f"{name}/" if name else ""
        if node["node_type"] == "group":
            below = [inner for inner in ordered if inner.startswith(prefix)]
            node = _group_node(
                node["attributes"], {inner.removeprefix(prefix): nodes[inner] for inner in below}
            )
        file = f"{prefix}{METADATA}"
        content = json.dumps(node, separators=(",", ":")).encode()
        written[file] = write_file(path / file, content)
    return written


def _group_node(attributes: Mapping[str, Any], below: Mapping[str, Any] = {}) -> dict[str, Any]:
    return {
        "attributes": dict(attributes),
        "zarr_format": 3,
        "consolidated_metadata": {
            "kind": "inline",
            "must_understand": False,
            "metadata": dict(below),
        },
        "node_type": "group",
    }
