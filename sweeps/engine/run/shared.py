"""Requirements of remote workers: the code and the cache of the command."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

from sweeps.engine.declare.paths import is_private
from sweeps.engine.objects import Objects
from sweeps.engine.resolve.keys import digest
from sweeps.engine.resolve.modules import SHADERS, module_spec, package_files


class RequirementError(RuntimeError):
    """A worker has other code than the command, or does not see its cache."""


@cache
def package_digest(name: str) -> str:
    """Return the hash of all sources and shaders of a package or module; empty if it is missing."""
    files, spec = package_files(name, SHADERS | {".py"}), module_spec(name)
    if spec and spec.has_location and spec.origin and not files:
        files = [(name, digest(Path(spec.origin).read_bytes()))]
    return digest(repr(files)) if files else ""


class Requirements(NamedTuple):
    """Digests of packages by name, the cache, and the name of a marker in it."""

    code: Mapping[str, str] = {}
    packs: Objects | None = None
    marker: str = ""

    def check(self) -> None:
        """Raise `RequirementError` if this process has other code or sees no marker."""
        differing = [name for name, code in self.code.items() if package_digest(name) != code]
        if differing:
            remedy = "it must have the code of this process"
            raise RequirementError(f"has different code of {', '.join(differing)}; {remedy}")
        if self.packs is not None:
            _check_marker(self.packs, self.marker)


@cache
def _check_marker(packs: Objects, mark: str) -> None:
    """Raise `RequirementError` if the marker is absent, or others may write to the folder."""
    content = None
    with suppress(OSError):
        content = packs.get(mark)
    if content is None:
        problem, remedy = "does not see the cache", "put it where all workers see it"
    elif isinstance(packs.path, Path) and not is_private(packs.path):
        problem, remedy = "sees files of another user in", "it must run as the same user"
    else:
        return
    raise RequirementError(f"{problem} {str(packs.path)!r} of this command; {remedy}")
