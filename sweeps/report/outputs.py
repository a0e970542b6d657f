"""Files of a report beside a store: their paths, and the rule by which they are replaced.

A report replaces or removes only files that a report wrote and nobody has changed since. The folder
of tables lists them with their digests, in the format of `sha256sum`. A page contains the digest of
its remaining content.
"""

from __future__ import annotations

import hashlib
import os
import re
import uuid
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from ncti.text import printable
from sweeps.engine.declare.paths import PathOrUrl, path_beside
from sweeps.engine.store.locks import folder_lock

SUFFIX = ".zarr"
LIST_NAME = ".written"  # the list of a folder
PAGE_META = "ncti-page"  # name of the meta element with the digest of a page
NO_DIGEST = 64 * "0"  # in place of the digest, when it is computed
HEAD_BYTES = 4096  # bytes of a page in which its digest stands
MAX_NAMES = 3  # files that a sentence names
FOLDER_MODE, FILE_MODE = 0o755, 0o644  # modes: others may never write

Entries = dict[str, tuple[str, ...]]  # digests by name

_LIST_LINE = re.compile(r"^([0-9a-f]{64})  ([^/\0\n\ufffd]+)\n", re.MULTILINE)
_PAGE_DIGEST = re.compile(rb'(<meta name="%s" content=")([0-9a-f]{64})(">)' % PAGE_META.encode())


def report_paths(path: PathOrUrl) -> tuple[Path, Path]:
    """Return the folder of tables and the file of the page of a store."""
    return tables_folder(path), page_file(path)


def tables_folder(path: PathOrUrl) -> Path:
    """Return the folder of a store's tables: of `q.zarr` `q-tables`, of `q` `q.tables`."""
    return _sibling_path(path, "tables")


def page_file(path: PathOrUrl) -> Path:
    """Return the file of a store's page: of `q.zarr` `q-report.html`, of `q` `q.report.html`."""
    return _sibling_path(path, "report.html")


def _sibling_path(path: PathOrUrl, suffix: str) -> Path:
    neighbour = path_beside(path)
    if neighbour.name.endswith(SUFFIX):
        return neighbour.with_name(f"{neighbour.name.removesuffix(SUFFIX)}-{suffix}")
    return neighbour.with_name(f"{neighbour.name}.{suffix}")


def write_own_files(
    folder: Path, contents: Mapping[str, bytes], *, instead_of: str = ""
) -> list[Path]:
    """Write files into a folder, created if missing, without overwriting other files.

    Parameters
    ----------
    folder : Path
        Folder. Several processes may write into it: a lock keeps the entries of all in its list.
    contents : mapping of str to bytes
        Contents by name.
    instead_of : str
        Suffix of the listed files to remove, except those written now or changed since.

    Returns
    -------
    list of Path
        Paths in the way, which were not replaced: files, the list, or the folder itself.

    Raises
    ------
    OSError
        If something cannot be written.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        return [folder]
    folder.mkdir(FOLDER_MODE, exist_ok=True)
    with folder_lock(folder):
        entries = _read_list(folder / LIST_NAME)
        if entries is None:
            return [folder / LIST_NAME]
        digests = {name: _digest(content) for name, content in contents.items()}
        for name in [name for name in entries if instead_of and name.endswith(instead_of)]:
            if name not in digests and _has_digest(folder / name, entries.pop(name)):
                (folder / name).unlink()
        changed_names = [
            name for name, digest in digests.items() if not _has_digest(folder / name, (digest,))
        ]
        free_names = [
            name
            for name in changed_names
            if not os.path.lexists(folder / name)
            or _has_digest(folder / name, entries.get(name, ()))
        ]
        # List old and new digests before writing, so that an interrupt leaves only listed files.
        _write_list(
            folder,
            entries | {name: (*entries.get(name, ()), digests[name]) for name in free_names},
        )
        for name in free_names:
            write_atomically(folder / name, contents[name])
        _write_list(folder, entries | {name: (digests[name],) for name in free_names})
    return [folder / name for name in changed_names if name not in free_names]


def _write_list(folder: Path, entries: Entries) -> None:
    """Write the list of a folder, unless it is unchanged."""
    lines = (f"{digest}  {name}\n" for name, digests in entries.items() for digest in digests)
    path, content = folder / LIST_NAME, "".join(lines).encode()
    if (content or path.exists()) and not _has_digest(path, (_digest(content),)):
        write_atomically(path, content)


def seal_page(page: str) -> bytes:
    """Return the bytes of a page, with its digest in place of `NO_DIGEST`."""
    content = page.encode("utf-8", "replace")
    return content.replace(NO_DIGEST.encode(), _digest(content).encode(), 1)


def is_free(path: Path) -> bool:
    """Return whether a page may be written to a path: nothing or an unchanged page is there."""
    if not os.path.lexists(path):
        return True
    if path.is_symlink() or not path.is_file():
        return False
    content = path.read_bytes()
    digest_match = _PAGE_DIGEST.search(content[:HEAD_BYTES])
    if not digest_match:
        return False
    begin, end = digest_match.span(2)
    return _digest(content[:begin] + NO_DIGEST.encode() + content[end:]) == digest_match[2].decode()


def blocked_sentence(paths: Sequence[Path]) -> str:
    """Return a sentence on files that are in the way."""
    names = ", ".join(printable(repr(str(path))) for path in paths[:MAX_NAMES])
    if (unlisted := len(paths) - MAX_NAMES) > 0:
        names += f" and {unlisted} more"
    return (
        f"{names} not overwritten: not created by ncti-report, or edited since; "
        "everything else is written"
    )


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file under another name, then move it, so that it is never seen incomplete."""
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}.partial")
    try:
        temporary.touch(FILE_MODE, exist_ok=False)
        temporary.write_bytes(content)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _read_list(path: Path) -> Entries | None:
    """Read digests by name from a list; None if the path is anything else."""
    if not os.path.lexists(path):
        return {}
    if path.is_symlink() or not path.is_file():
        return None
    text = path.read_text(encoding="utf-8", errors="replace")
    entries: Entries = {}
    for digest, name in _LIST_LINE.findall(text):
        entries[name] = (*entries.get(name, ()), digest)
    return entries if _LIST_LINE.sub("", text) == "" else None


def _has_digest(path: Path, digests: Iterable[str]) -> bool:
    """Return whether a path is a file, and no link, with one of some digests."""
    if path.is_symlink() or not path.is_file():
        return False
    return _digest(path.read_bytes()) in digests


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
