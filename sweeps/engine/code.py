"""Hashes of a function's code: the modules that it imports, and the versions of libraries.

A stored result is reused only while this hash is the same, so whatever it omits must not
affect results. Imports are read from the sources, without importing anything. Whole modules are
followed, wherever in a file they are imported except under `if TYPE_CHECKING`.
"""

from __future__ import annotations

import ast
import dis
import hashlib
import inspect
import json
import os
import re
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec, resolve_name
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from sweeps.engine.errors import ConfigurationError

DATA_SUFFIXES = frozenset({".vert", ".frag", ".glsl"})
ENGINE = frozenset({__name__.rpartition(".")[0]})

Reference = tuple[str, str]  # a module, and a name looked up in it: "" for none, "*" for all
Place = tuple[Path | None, tuple[str, ...]]  # a module's file, and folders of modules below it
_DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


@dataclass(frozen=True)
class CodeDigest:
    """Hash of a function's code, with the modules and libraries that it covers."""

    digest: str  # hexadecimal SHA-256; depends on no absolute path and no order of discovery
    modules: tuple[str, ...]  # whose sources count, sorted
    libraries: Mapping[str, str]  # versions of the distributions that count, by name


@dataclass(frozen=True)
class _Module:
    """A module hashed by its source; has no file if it was typed into an interactive session."""

    name: str
    file: Path | None
    package: str
    digest: str
    references: frozenset[Reference] = field(compare=False, default=frozenset())
    names: frozenset[str] = field(compare=False, default=frozenset())
    acts: bool = field(compare=False, default=False)  # importing it does more than define names


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
    modules, data, tops = _walk(start, roots, without)
    libraries = dict(pair for top in tops for pair in _versions(top))
    for name in also:
        try:
            libraries[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            raise ConfigurationError(
                f"also: {name!r} is not the name of an installed distribution, as 'numpy' is"
            ) from None
    parts = json.dumps([start.name, plain.__qualname__, modules, data, libraries], sort_keys=True)
    digest = hashlib.sha256(parts.encode()).hexdigest()
    return CodeDigest(digest, tuple(sorted(modules)), dict(sorted(libraries.items())))


class OtherCode(RuntimeError):
    """The code of a process differs from that of the calling process."""


@cache
def package_digest(name: str) -> str:
    """Return the hash of all sources and shaders of a package or module; empty if it is missing."""
    file, folders = _place(name) or (None, ())
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


@cache
def _walk(
    start: _Module, roots: frozenset[str], without: frozenset[str]
) -> tuple[dict[str, str], dict[str, str], frozenset[str]]:
    """Return hashes of a module's dependencies and their data files, and the libraries imported."""
    found, waiting = {start.name: start}, [start]
    libraries: set[str] = set()
    while waiting:
        modules, tops = _edges(waiting.pop(), roots, without)
        libraries |= tops
        for module in filter(None, map(_module, modules - found.keys())):
            found[module.name] = module
            waiting.append(module)
    hashes = {module.name: module.digest for module in found.values()}
    folders = {module.package: module.file.parent for module in found.values() if module.file}
    data = {name: value for item in folders.items() for name, value in _data(*item)}
    return hashes, data, frozenset(libraries)


def _within(name: str, packages: frozenset[str]) -> bool:
    """Return whether a module is in, or is itself, one of some packages."""
    return any(f"{name}.".startswith(f"{package}.") for package in packages)


@cache
def _edges(
    module: _Module, roots: frozenset[str], without: frozenset[str]
) -> tuple[frozenset[str], frozenset[str]]:
    """Return the modules (hashed by source) and the libraries that a module imports."""
    modules: set[str] = set()
    libraries: set[str] = set()
    for owner, name in module.references:
        top = owner.partition(".")[0]
        inner = f"{owner}.{name}" if name else owner
        standard = top in sys.stdlib_module_names
        if _within(inner, without):
            continue
        if _within(inner, roots) or not (standard or _versions(top)):
            modules |= _targets(owner, name)
        elif not standard:
            libraries.add(top)
    # parent packages whose import has side effects, such as setting a variable
    parts = module.name.split(".")
    for parent in (".".join(parts[:i]) for i in range(1, len(parts))):
        if _within(parent, roots) and (above := _module(parent)) and above.acts:
            modules.add(parent)
    return frozenset(n for n in modules if not _within(n, without)), frozenset(libraries)


def _targets(owner: str, name: str) -> set[str]:
    """Return modules imported by `from owner import name`: of that name, or defining it."""
    package = _module(owner)
    if name and name != "*" and _place(f"{owner}.{name}") is not None:
        # a package may bind the name of one of its modules to another object
        renamed = package is not None and name in package.names
        return {f"{owner}.{name}", owner} if renamed else {f"{owner}.{name}"}
    if package is None:
        return set()
    # created on demand by the package, from an unknown one of its modules
    hidden = "__getattr__" in package.names and name not in package.names
    if name == "*" or (hidden and name and not name.startswith("__")):
        files = (
            package.file.parent.iterdir()
            if package.file and package.name == package.package
            else ()
        )
        stems = {entry.name.partition(".")[0] for entry in files} - {"", "__init__"}
        return {owner, *(f"{owner}.{stem}" for stem in stems)}
    return {owner}


def _start(function: FunctionType) -> _Module:
    """Return the module that defines a function, or only the function if that has no file."""
    space = function.__globals__
    # the spec names the module that `python -m` runs as __main__
    name = getattr(space.get("__spec__"), "name", space["__name__"])
    file = Path(space.get("__file__") or "")
    if file.is_file():
        return _open(name, file)
    try:
        code = textwrap.dedent(inspect.getsource(function)).encode()
        references, *_ = _parse(code, "")
    except (OSError, SyntaxError):
        raise ConfigurationError(
            f"function {function.__qualname__} of {name} has no source to read: define it in a file"
        ) from None
    for used in _global_names(function.__code__) & space.keys():
        if not isinstance(space[used], ModuleType):
            raise ConfigurationError(
                f"function {function.__qualname__} uses {used} of a session: define both in a file"
            )
        references |= {(space[used].__name__, "")}
    return _Module(name, None, "", hashlib.sha256(code).hexdigest(), references)


def _global_names(code: CodeType) -> set[str]:
    """Return global names used by a function's code and code nested in it."""
    names = {line.argval for line in dis.get_instructions(code) if line.opname == "LOAD_GLOBAL"}
    inner = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return names.union(*map(_global_names, inner))


def _module(name: str) -> _Module | None:
    """Return a module read from its file; None if it is missing or a namespace package."""
    place = _place(name)
    return _open(name, place[0]) if place and place[0] else None


def _place(name: str) -> Place | None:
    """Return the location of a module, found without importing anything."""
    top, *parts = name.split(".")
    try:
        spec = find_spec(top)  # a top-level name: nothing is imported to find it
    except ValueError:  # __main__, or a module created at run time
        return None
    if spec is None:
        return None
    file = Path(spec.origin) if spec.has_location and spec.origin else None
    place: Place | None = (file, tuple(spec.submodule_search_locations or ()))
    for part in parts:
        place = place and _place_in([os.path.join(folder, part) for folder in place[1]])
    return place


def _place_in(paths: list[str]) -> Place | None:
    """Return the location of a module among some paths, in the order of Python's import."""
    for path in paths:
        if os.path.isfile(file := os.path.join(path, "__init__.py")):
            return Path(file), (path,)
        for suffix in (*EXTENSION_SUFFIXES, ".py"):
            if os.path.isfile(path + suffix):
                return Path(path + suffix), ()
    spaces = tuple(filter(os.path.isdir, paths))
    return (None, spaces) if spaces else None


def _data(package: str, folder: Path) -> Iterator[tuple[str, str]]:
    """Yield paths and hashes of the shaders of a package, without those of its subpackages."""
    for inner, folders, files in os.walk(folder if package else ""):
        folders[:] = [n for n in folders if not os.path.isfile(f"{inner}/{n}/__init__.py")]
        for file in (Path(inner, name) for name in files):
            if file.suffix in DATA_SUFFIXES:
                path = file.relative_to(folder).as_posix()
                yield f"{package}/{path}", hashlib.sha256(file.read_bytes()).hexdigest()


def _open(name: str, file: Path) -> _Module:
    """Return a module; its file is read again after a change."""
    status = file.stat()
    return _read(name, file, status.st_mtime_ns, status.st_size)


@cache
def _read(name: str, file: Path, modified: int, size: int) -> _Module:
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    code = file.read_bytes()
    read = _parse(code, package) if file.suffix == ".py" else ()  # else compiled
    return _Module(name, file, package, hashlib.sha256(code).hexdigest(), *read)


def _parse(code: bytes, package: str) -> tuple[frozenset[Reference], frozenset[str], bool]:
    """Return references and bound names of a source, and whether importing it has side effects."""
    tree = ast.parse(code)
    references: set[Reference] = set()
    names: set[str] = set()
    imports: dict[str, set[str]] = {}  # local name: what it may refer to
    chains: set[tuple[str, ...]] = set()
    for node in _running(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            for alias in node.names:
                local, dotted, found = _imported(node, alias, package)
                imports.setdefault(local, set()).add(dotted)
                references |= found
        elif isinstance(node, ast.Attribute):
            chains.add(_chain(node))
        elif isinstance(node, _DEFINITIONS):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.Call):
            references |= _called(node, package)
    # after `import a`, `a.b.c` reaches modules that `a` may import on demand
    for local, *rest in chains:
        for dotted in imports.get(local, ()):
            references |= {(".".join([dotted, *rest[:i]]), name) for i, name in enumerate(rest)}
    names |= imports.keys()
    return frozenset(references), frozenset(names), not all(map(_defines, tree.body))


def _running(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield nodes of a source except those under `TYPE_CHECKING`."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and _chain(node.test)[-1] == "TYPE_CHECKING":
            waiting.extend(node.orelse)
        else:
            yield node
            waiting.extend(ast.iter_child_nodes(node))


def _imported(
    node: ast.Import | ast.ImportFrom, alias: ast.alias, package: str
) -> tuple[str, str, set[Reference]]:
    """Yield the local name that an import binds, its target, and the references looked up."""
    if isinstance(node, ast.ImportFrom):
        owner = _absolute("." * node.level + (node.module or ""), package)
        return alias.asname or alias.name, f"{owner}.{alias.name}", {(owner, alias.name)}
    if alias.asname:
        return alias.asname, alias.name, {(alias.name, "")}
    parts = alias.name.split(".")
    return parts[0], parts[0], {(".".join(parts[:i]), "") for i in range(1, len(parts) + 1)}


def _called(node: ast.Call, package: str) -> set[Reference]:
    """Return references of `import_module("a.b")`; a name computed at run time is unknown."""
    if node.args and _chain(node.func)[-1] in {"import_module", "__import__"}:
        name = getattr(node.args[0], "value", None)
        return {(_absolute(name, package), "")} if isinstance(name, str) else set()
    return set()


def _absolute(name: str, package: str) -> str:
    """Return the absolute name of a module; unchanged if Python would refuse it."""
    try:
        return resolve_name(name, package)
    except ImportError:
        return name


def _chain(node: ast.expr) -> tuple[str, ...]:
    """Return the names of `a.b.c`; the first is empty unless the expression begins with a name."""
    if isinstance(node, ast.Attribute):
        return (*_chain(node.value), node.attr)
    return (node.id,) if isinstance(node, ast.Name) else ("",)


def _defines(node: ast.stmt) -> bool:
    """Return whether a top-level statement only defines names of its module."""
    if isinstance(node, ast.Assign):
        return all(isinstance(target, ast.Name | ast.Tuple) for target in node.targets)
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant)  # a docstring
    if isinstance(node, ast.If):
        return _chain(node.test)[-1] == "TYPE_CHECKING"
    return isinstance(node, (ast.Import, ast.ImportFrom, ast.AnnAssign, *_DEFINITIONS))


@cache
def _versions(top: str) -> tuple[tuple[str, str], ...]:
    """Return distributions of a top-level package with versions; empty if it is only a source."""
    names = {owner.metadata["Name"] for owner in _distributions().get(top, ())}
    if not names and _place(top) is None:
        return ((top, "not installed"),)
    return tuple((name, metadata.version(name)) for name in sorted(names))


@cache
def _distributions() -> dict[str, list[metadata.Distribution]]:
    """Return the distributions that provide each top-level package.

    Like `metadata.packages_distributions`, which is slow and, in Python 3.11, omits packages
    that are a single compiled file.
    """
    found: dict[str, list[metadata.Distribution]] = {}
    for owner in metadata.distributions():
        files = owner.read_text("RECORD") or owner.read_text("top_level.txt") or ""
        for top in {name.partition(".")[0] for name in re.findall("^[^/,\n]+", files, re.M)}:
            found.setdefault(top, []).append(owner)
    return found
