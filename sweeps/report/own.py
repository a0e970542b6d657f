"""Files beside a store that the report wrote: only these are replaced or removed, if unchanged.

The folder of tables has a list of them with their digests, as of `sha256sum`. A page contains the
digest of the rest of it.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
import uuid
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from sweeps.report.words import printable

WRITTEN = ".written"  # the list of a folder
PAGE = "ncti-page"  # name of the meta element with the digest of a page
UNKNOWN = 64 * "0"  # in place of the digest, when it is computed
BEGINNING = 4096  # bytes of a page in which its digest stands
NAMED = 3  # files that a sentence names
FOLDER, FILE = 0o755, 0o644  # modes: others may never write

Listed = dict[str, tuple[str, ...]]  # digests by name

_LINE = re.compile(r"^([0-9a-f]{64})  ([^/\0\n\ufffd]+)\n", re.MULTILINE)
_PAGE = re.compile(rb'(<meta name="%s" content=")([0-9a-f]{64})(">)' % PAGE.encode())


class OwnFiles:
    """The files of a folder, which is made if missing, that were written by means of this class.

    `kept` has the paths at which others are in the way, so that they were not written. Several
    processes may write into one folder: a lock keeps the entries of all in the list. OSError if
    something cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.kept: list[Path] = []
        self._listed: Listed = {}
        if os.path.lexists(folder) and not folder.is_dir():
            self.kept.append(folder)
        else:
            folder.mkdir(FOLDER, exist_ok=True)
            self._read()

    @property
    def names(self) -> list[str]:
        """Return names of the listed files."""
        return list(self._listed)

    def put(self, name: str, content: bytes) -> None:
        """Write a file, unless another one is in its place."""
        path, digest = self.folder / name, _digest(content)
        if self._is_closed() or _has(path, (digest,)):
            return
        with _locked(self.folder):
            self._read()
            before = self._listed.get(name, ())
            if os.path.lexists(path) and not _has(path, before):
                self.kept.append(path)
            elif not self._is_closed():
                # Listed before and after with both digests: an interrupt leaves an own file.
                self._list({**self._listed, name: (*before, digest)})
                write_whole(path, content)
                self._list({**self._listed, name: (digest,)})

    def remove(self, name: str) -> None:
        """Remove a listed file, unless it was changed; forget it in any case."""
        if self._is_closed() or name not in self._listed:
            return
        with _locked(self.folder):
            self._read()
            digests = self._listed.pop(name, ())
            if _has(self.folder / name, digests):
                (self.folder / name).unlink()
            if digests:
                self._list(self._listed)

    def _is_closed(self) -> bool:
        """Return whether nothing may be written: another file is the folder, or its list."""
        return not {self.folder, self.folder / WRITTEN}.isdisjoint(self.kept)

    def _read(self) -> None:
        """Read the list, which is in the way if it is anything else."""
        listed = _read_list(self.folder / WRITTEN)
        if listed is None:
            self.kept.append(self.folder / WRITTEN)
        self._listed = listed or {}

    def _list(self, listed: Listed) -> None:
        lines = (f"{digest}  {name}\n" for name, digests in listed.items() for digest in digests)
        write_whole(self.folder / WRITTEN, "".join(lines).encode())
        self._listed = listed


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Wait for the lock of a folder, which the operating system releases with a process.

    Where the file system has no locks, nothing is locked.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def sealed(page: str) -> bytes:
    """Return the bytes of a page that contains `UNKNOWN`, with its digest there instead."""
    content = page.encode("utf-8", "replace")
    return content.replace(UNKNOWN.encode(), _digest(content).encode(), 1)


def is_free(path: Path) -> bool:
    """Return whether a page may be written to a path: nothing or an unchanged page is there."""
    if not os.path.lexists(path):
        return True
    if path.is_symlink() or not path.is_file():
        return False
    content = path.read_bytes()
    sealed_by = _PAGE.search(content[:BEGINNING])
    if not sealed_by:
        return False
    begin, end = sealed_by.span(2)
    return _digest(content[:begin] + UNKNOWN.encode() + content[end:]) == sealed_by[2].decode()


def sentence_of(kept: Sequence[Path]) -> str:
    """Return a sentence on files that are in the way."""
    named = ", ".join(printable(repr(str(path))) for path in kept[:NAMED])
    if (more := len(kept) - NAMED) > 0:
        named += f" and {more} more"
    why = (
        "stay as they are, since no report wrote them or they were changed since"
        if len(kept) > 1
        else "stays as it is, since no report wrote it or it was changed since"
    )
    return f"{named} {why}; everything else is written"


def write_whole(path: Path, content: bytes) -> None:
    """Write a file under another name, then move it, so that it is never seen incomplete."""
    made = path.with_name(f".{path.name}.{uuid.uuid4().hex}.partial")
    try:
        made.touch(FILE, exist_ok=False)
        made.write_bytes(content)
        made.replace(path)
    finally:
        made.unlink(missing_ok=True)


def _read_list(path: Path) -> Listed | None:
    """Return digests by name as a list has them; None if it is anything else."""
    if not os.path.lexists(path):
        return {}
    if path.is_symlink() or not path.is_file():
        return None
    text = path.read_text(encoding="utf-8", errors="replace")
    listed: Listed = {}
    for digest, name in _LINE.findall(text):
        listed[name] = (*listed.get(name, ()), digest)
    return listed if _LINE.sub("", text) == "" else None


def _has(path: Path, digests: Iterable[str]) -> bool:
    """Return whether a path is a file, and no link, with one of some digests."""
    if path.is_symlink() or not path.is_file():
        return False
    return _digest(path.read_bytes()) in digests


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
