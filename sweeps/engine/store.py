"""Stores: the results of a sweep as one zarr DataTree, written whole or not at all, and read back.

Equal input, given in the same order, makes equal bytes: a store holds no times, hosts or paths.
The metadata of a group repeat those of all below it ("consolidated"), so that a store opens by one
file, at the root or at any group.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from itertools import accumulate
from pathlib import Path
from typing import Any

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.folders import (
    MANIFEST,
    PARTIAL,
    check_target,
    hidden,
    put_in_place,
    read_manifest,
    real_place,
    remove_folder,
    write_file,
)
from sweeps.engine.interrupts import interruptible
from sweeps.engine.packs import raise_shortage, seal
from sweeps.engine.zarr_array import (
    METADATA,
    Group,
    encode,
    metadata,
    nested,
    plain,
    regions,
)

Nodes = dict[str, dict[str, Any]]  # metadata by path in the store


def write_store(
    path: Path,
    groups: Mapping[str, Group],
    attributes: Mapping[str, Any],
    *,
    everywhere: tuple[str, ...] = (),
) -> None:
    """Write a store and move it to its place whole, replacing an older store.

    Hold its lock meanwhile (`locked`). Memory holds a few chunks. If anything fails, the
    place is unchanged. Readers of the old store must open it again. Files are left to the
    operating system to flush: `verify` finds damage of a power cut. `groups` are by path, as
    'classification/acn'; parents need not be given. `attributes` are those of the root, of which
    all groups repeat those named `everywhere`.
    """
    check_target(path)
    place = real_place(path)
    partial = hidden(place, PARTIAL)
    try:
        files = _write_metadata(partial, _nodes(groups, attributes, everywhere))
        files |= _write_chunks(partial, groups)
        write_file(partial / MANIFEST, seal(files))
        check_target(path)  # another process may have written something there
        put_in_place(partial, place)
    finally:
        remove_folder(partial)  # an unfinished store, or the older one


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
        raise_shortage(error)
        raise ConfigurationError(
            f"store is {str(path)!r}, whose {METADATA} cannot be read; "
            "give another path or remove it"
        ) from error


def _nodes(
    groups: Mapping[str, Group], attributes: Mapping[str, Any], everywhere: tuple[str, ...]
) -> Nodes:
    """Return the metadata of the root, groups and arrays by path, the root's being empty."""
    shared = plain({name: attributes[name] for name in everywhere})
    nodes = {"": _group_node(plain(attributes))}
    for name, group in groups.items():
        for parent in accumulate(name.split("/"), "{}/{}".format):
            nodes.setdefault(parent, _group_node(shared))
        nodes[name] = _group_node({**shared, **group.attributes})
    for name, group in groups.items():
        for inner, array in group.arrays.items():
            if f"{name}/{inner}" in nodes:
                raise ValueError(f"'{name}/{inner}' is a group and an array")
            nodes[f"{name}/{inner}"] = metadata(array)
    return nodes


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


def _write_metadata(path: Path, nodes: Nodes) -> dict[str, int]:
    """Write the metadata of all nodes; return checksums of the files."""
    # zarr reads the children of a group only if they follow each other.
    ordered = sorted(nodes, key=lambda name: (name.count("/"), name.rpartition("/")[0]))
    files: dict[str, int] = {}
    for name, node in nodes.items():
        prefix = f"{name}/" if name else ""
        if node["node_type"] == "group":
            below = [one for one in ordered if one.startswith(prefix) and one]
            inside = {one.removeprefix(prefix): nodes[one] for one in below}
            node = _group_node(node["attributes"], inside)
        content = json.dumps(node, separators=(",", ":")).encode()
        files[f"{prefix}{METADATA}"] = write_file(path / f"{prefix}{METADATA}", content)
    return files


def _write_chunks(path: Path, groups: Mapping[str, Group]) -> dict[str, int]:
    """Write all chunks that are not empty; return checksums of the files."""
    files: dict[str, int] = {}
    arrays = [
        (f"{name}/{inner}", array)
        for name, group in groups.items()
        for inner, array in group.arrays.items()
    ]
    with interruptible():
        for name, array in arrays:
            for chunk, region in regions(array):
                content = encode(array, region)
                if content is not None:
                    files[f"{name}/{chunk}"] = write_file(path / name / chunk, content)
    return files
