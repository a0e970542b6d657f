"""Hashes of a function's code: the statements that it reaches, and the versions of libraries.

A stored result is reused only while this hash is the same, so whatever it omits must not affect
results. The statements that the function reaches count (`sweeps.engine.reach`), as they compile:
without comments, docstrings and layout, and without labels and help of declarations.
"""

from __future__ import annotations

import dis
import hashlib
import inspect
import json
import os
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.libraries import versions
from sweeps.engine.reach import WHOLE, graph_of
from sweeps.engine.sources import Module, open_module, place

DATA_SUFFIXES = frozenset({".vert", ".frag", ".glsl"})
ENGINE = frozenset({__name__.rpartition(".")[0]})


@dataclass(frozen=True)
class CodeDigest:
    """Hash of a function's code, with the modules and libraries that it covers."""

    digest: str  # hexadecimal SHA-256; depends on no absolute path and no order of discovery
    modules: tuple[str, ...]  # that are imported, sorted
    libraries: Mapping[str, str]  # versions of the distributions that count, by name


def code_digest(
    function: Callable[..., Any],
    *,
    roots: frozenset[str],
    without: frozenset[str] = ENGINE,
    also: tuple[str, ...] = (),
) -> CodeDigest:
    """Return the hash of a function's name and code, as of the first call in this process.

    Parameters
    ----------
    function : callable
        A plain function, decorated or not. Values bound to its closure do not count.
    roots, without : frozenset of str
        Packages and modules, by dotted names, whose sources (and shaders) count, and do not count,
        with all below them. Of other imports outside the standard library the version of the
        distribution counts, or the source when no distribution has it.
    also : tuple of str
        Further distributions whose versions count: those that libraries use without importing them.

    Raises
    ------
    ConfigurationError
        If the function has no source to read, or a distribution of `also` is not installed.
    TypeError
        If `function` is not a Python function.
    """
    plain = inspect.unwrap(function)
    if not isinstance(plain, FunctionType):
        raise TypeError(f"{function!r} is not a Python function")
    start = _start(plain)
    first, *inner = plain.__qualname__.split(".")
    begin = start.bound.get(first, [WHOLE])
    # made or wrapped by a call, such as `f = scaled(2)(g)`, which may be anywhere in the module
    wrapped = isinstance(function, FunctionType) and function is not plain
    by_call = wrapped and not all(at >= 0 and start.statements[at].decorators for at in begin)
    if "<locals>" in inner or by_call:
        begin = [WHOLE]
    graph = graph_of(roots, without)
    code, tops = graph.closure(start, begin)
    modules = sorted(code)
    statements = {name: found for name, found in code.items() if found}
    places = {(of.package, of.folder) for of in map(graph.module, modules) if of and of.folder}
    data = dict(pair for package, folder in places for pair in _data(package, folder))
    libraries = dict(pair for top in tops for pair in versions(top))
    for name in also:
        try:
            libraries[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            raise ConfigurationError(
                f"also: {name!r} is not the name of an installed distribution, as 'numpy' is"
            ) from None
    parts = json.dumps(
        [start.name, plain.__qualname__, statements, data, libraries], sort_keys=True
    )
    digest = hashlib.sha256(parts.encode()).hexdigest()
    return CodeDigest(digest, tuple(modules), dict(sorted(libraries.items())))


class OtherCode(RuntimeError):
    """The code of a process differs from that of the calling process."""


@cache
def package_digest(name: str) -> str:
    """Return the hash of all sources and shaders of a package or module; empty if it is missing."""
    file, folders = place(name) or (None, ())
    top = Path(folders[0] if folders else file or "").parent
    files = [*([file] if file else []), *(one for of in folders for one in Path(of).rglob("*"))]
    found = sorted(
        (path.relative_to(top).as_posix(), path.read_bytes())
        for path in files
        if path.suffix in {".py", *DATA_SUFFIXES}
    )
    return hashlib.sha256(repr(found).encode()).hexdigest() if found else ""


def check_code(digests: Mapping[str, str]) -> None:
    """Raise `OtherCode` if the digest of a package differs in this process."""
    if other := [name for name, digest in digests.items() if package_digest(name) != digest]:
        raise OtherCode(f"has other code of {', '.join(other)}; it must have that of this process")


def _start(function: FunctionType) -> Module:
    """Return the module that defines a function, or only the function if that has no file."""
    space = function.__globals__
    # the spec names the module that `python -m` runs as __main__
    name = getattr(space.get("__spec__"), "name", space["__name__"])
    file = Path(space.get("__file__") or "")
    if file.is_file():
        return open_module(name, file)
    try:
        typed = Module(name, None, "", textwrap.dedent(inspect.getsource(function)).encode())
    except (OSError, SyntaxError):
        raise ConfigurationError(
            f"function {function.__qualname__} of {name} has no source to read: define it in a file"
        ) from None
    for used in _global_names(function.__code__) & space.keys():
        if not isinstance(space[used], ModuleType):
            raise ConfigurationError(
                f"function {function.__qualname__} uses {used} of a session: define both in a file"
            )
        typed.imports[used] = {(space[used].__name__, "")}
        typed.references.add((space[used].__name__, ""))
    return typed


def _global_names(code: CodeType) -> set[str]:
    """Return global names used by a function's code and code nested in it."""
    names = {line.argval for line in dis.get_instructions(code) if line.opname == "LOAD_GLOBAL"}
    inner = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return names.union(*map(_global_names, inner))


@cache
def _data(package: str, folder: Path) -> tuple[tuple[str, str], ...]:
    """Return paths and hashes of the shaders of a package, without those of its subpackages."""
    found = []
    for inner, folders, files in os.walk(folder if package else ""):
        folders[:] = [n for n in folders if not os.path.isfile(f"{inner}/{n}/__init__.py")]
        for file in (Path(inner, name) for name in files):
            if file.suffix in DATA_SUFFIXES:
                path = file.relative_to(folder).as_posix()
                found.append((f"{package}/{path}", hashlib.sha256(file.read_bytes()).hexdigest()))
    return tuple(found)
