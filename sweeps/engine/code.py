"""Hashes of a function's code: the sources behind it, and the versions of libraries.

A stored result is reused only while this hash is the same, so whatever it omits must not affect
results. A module counts as a whole, with all that it imports, unless it uses the engine, as the
file of an experiment does: of that count the statements that bind the names a function uses, in
turn, and those that may do more than bind names.
"""

from __future__ import annotations

import ast
import dis
import hashlib
import inspect
import json
import textwrap
from collections.abc import Callable, Mapping, Set
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.sources import (
    ENGINE,
    Module,
    Reference,
    is_standard,
    open_module,
    place,
    versions,
    within,
)

SHADERS = frozenset({".vert", ".frag", ".glsl"})
# They may reach any name, and any attribute of a module.
ANY_NAME = frozenset(
    {"eval", "exec", "globals", "modules", "vars", "__globals__", "__subclasses__"}
)
ANY_ATTRIBUTE = frozenset({"getattr", "attrgetter", "methodcaller", "__dict__"})

Function = tuple[str, str]  # module and qualified name
Node = tuple[str, str]  # a module, and a name that it binds, or
LOADED, WHOLE = "", "*"  # that it is imported, or all of it


@dataclass(frozen=True)
class CodeDigest:
    """Hash of a function's code, with the modules and libraries that it covers."""

    digest: str  # hexadecimal SHA-256; depends on no absolute path and no order of discovery
    modules: tuple[str, ...]  # that are imported, sorted
    libraries: Mapping[str, str]  # versions of the distributions that count, by name


@dataclass
class _Edges:
    """Numbers of the statements of a node, and what these lead to."""

    statements: set[int] = field(default_factory=set)
    nodes: set[Node] = field(default_factory=set)
    libraries: set[str] = field(default_factory=set)


class Code:
    """The code behind functions, as of their first use.

    Parameters
    ----------
    roots : frozenset of str
        Packages and modules, by dotted names, whose sources (and shaders) count, with all below
        them but the engine. Of other imports outside the standard library the version of the
        distribution counts, or the source when no distribution has it.
    stages : frozenset of (str, str)
        Functions of stages, as `place_of` returns them: their decorators only declare.
    """

    def __init__(self, roots: frozenset[str], stages: frozenset[Function] = frozenset()) -> None:
        self._roots, self._stages = roots, stages
        self._started: dict[str, Module] = {}
        self._module = cache(self._find_module)
        self._edges = cache(self._find_edges)
        self._kind = cache(self._find_kind)

    def digest(self, function: Callable[..., Any]) -> CodeDigest:
        """Return the hash of a function's name and code.

        Parameters
        ----------
        function : callable
            A plain function, decorated or not, or a dataclass. Of its closure count functions,
            numbers, texts, and tuples of them, as of a function that another returns.

        Raises
        ------
        ConfigurationError
            If the function has no source to read.
        TypeError
            If `function` is not a Python function.
        """
        given: Any = function.__dict__["__init__"] if isinstance(function, type) else function
        plain = inspect.unwrap(given)
        if not isinstance(plain, FunctionType):
            raise TypeError(f"{function!r} is not a Python function")
        functions, values = _held(plain)
        first, *inner = plain.__qualname__.split(".")
        # What is wrapped, or inside another function, may be made anywhere in the module.
        name = WHOLE if given is not plain or "<locals>" in inner else first
        waiting = [(self._start(plain), name), *((self._start(one), WHOLE) for one in functions)]
        seen: set[Node] = set()
        statements: dict[str, set[int]] = {}
        tops: set[str] = set()
        while waiting:
            node = waiting.pop()
            if node not in seen:
                seen.add(node)
                edges = self._edges(*node)
                waiting += edges.nodes
                statements.setdefault(node[0], set()).update(edges.statements)
                tops |= edges.libraries
        modules = {name: of for name in sorted(statements) if (of := self._module(name))}
        code = {
            name: [of.statements[number].digest for number in sorted(statements[name])]
            for name, of in modules.items()
        }
        libraries = dict(pair for top in tops for pair in versions(top))
        folders = {(of.package, of.file.parent) for of in modules.values() if of.file}
        shaders = sorted(pair for name, of in folders if name for pair in _files(name, of, SHADERS))
        parts = [place_of(plain), [*map(place_of, functions)], values, code, shaders, libraries]
        digest = _hash(json.dumps(parts, sort_keys=True).encode())
        return CodeDigest(digest, tuple(modules), dict(sorted(libraries.items())))

    def _start(self, function: FunctionType) -> str:
        """Return the name of the module that defines a function, and open it.

        A function typed into a session is a module of its own, with the modules that it uses.
        """
        name, qualified = place_of(function)
        space = function.__globals__
        file = Path(space.get("__file__") or "")
        if file.is_file():
            self._started.setdefault(name, self._open(name, file))
            return name
        try:
            source = textwrap.dedent(inspect.getsource(function))
            ast.parse(source)
        except (OSError, SyntaxError):
            raise ConfigurationError(
                f"function {qualified} of {name} has no source to read: define it in a file"
            ) from None
        for used in sorted(_global_names(function.__code__) & space.keys()):
            if not isinstance(space[used], ModuleType):
                raise ConfigurationError(
                    f"function {qualified} uses {used} of a session: define both in a file"
                )
            source += f"\nimport {space[used].__name__} as {used}"
        name = f"{name}:{qualified}"
        self._started[name] = Module(name, None, source, frozenset())
        return name

    def _open(self, name: str, file: Path) -> Module:
        stages = frozenset(function for module, function in self._stages if module == name)
        return open_module(name, file, stages)

    def _find_module(self, name: str) -> Module | None:
        if name in self._started:
            return self._started[name]
        spec = place(name)
        file = spec.origin if spec and spec.has_location else None
        return self._open(name, Path(file)) if file else None

    def _find_kind(self, name: str) -> str:
        """Return whether a module counts by its source, as a library, or not at all."""
        if within(name, ENGINE):
            return ""
        is_library = not is_standard(name) and bool(versions(name.partition(".")[0]))
        if within(name, self._roots) or not (is_standard(name) or is_library):
            return "source"
        return "library" if is_library else ""

    def _find_edges(self, name: str, what: str) -> _Edges:
        """Return the statements of a node, and where they lead to."""
        found, of = _Edges(), self._module(name)
        if of is None:
            return found
        if what == LOADED:
            found.statements.update(n for n, one in enumerate(of.statements) if one.acts)
            parts = name.split(".")
            above = {".".join(parts[:end]) for end in range(1, len(parts))}
            found.nodes |= {(one, LOADED) for one in above if self._kind(one) == "source"}
        else:
            found.nodes.add((name, LOADED))
            if of.is_apart:
                numbers = range(len(of.statements)) if what == WHOLE else of.bound.get(what, ())
                found.statements.update(numbers)
        used = None if of.uses & ANY_ATTRIBUTE else of.uses
        for statement in (of.statements[number] for number in found.statements):
            for target in statement.imports:
                self._refer(target, used, found)
            if of.is_apart:
                found.nodes |= {(name, one) for one in statement.uses & of.bound.keys()}
                found.nodes |= {(name, WHOLE)} if statement.uses & ANY_NAME else set()
        return found

    def _refer(self, target: Reference, used: Set[str] | None, found: _Edges) -> None:
        """Add what an import refers to; `used` are the names in its module, None if any may be."""
        owner, name = target
        inner = f"{owner}.{name}" if name else owner
        kind = self._kind(inner)
        if kind == "library":
            found.libraries.add(owner.partition(".")[0])
        if kind != "source":
            return
        is_module = not name or (name != WHOLE and place(inner) is not None)
        package = self._module(owner) if name else None
        if package is not None:
            found.nodes.add((owner, name))
            unknown = package.is_lazy and not is_module and name not in package.bound
            if name == WHOLE or unknown:
                self._add_below(package, None, found)
        of = self._module(inner) if is_module else None
        if of is not None:
            names = {WHOLE} if used is None else of.bound.keys() & used
            found.nodes |= {(inner, one) for one in (LOADED, *names)}
            if of.is_lazy:
                self._add_below(of, used, found)

    def _add_below(self, of: Module, used: Set[str] | None, found: _Edges) -> None:
        """Add the modules below a package, or those with names that are used."""
        if of.file is None or of.package != of.name:
            return
        for file in of.file.parent.rglob("*.py"):
            parts = file.relative_to(of.file.parent).with_suffix("").parts
            parts = parts[:-1] if parts[-1] == "__init__" else parts
            inner = ".".join((of.name, *parts))
            if (used is None or used >= set(parts)) and self._kind(inner) == "source":
                found.nodes.add((inner, WHOLE))


def _held(function: FunctionType) -> tuple[list[FunctionType], list[str]]:
    """Return functions, and the texts of plain values, that a closure holds at any depth."""
    functions, values = [function], []
    for holder in functions:  # which grows
        for cell in holder.__closure__ or ():
            with suppress(ValueError):  # an empty cell
                value = cell.cell_contents
                if isinstance(value, FunctionType):
                    functions += [value] * (value not in functions)
                elif _is_plain(value):
                    values.append(repr(value))
    return functions[1:], values


def _is_plain(value: object) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, bool | int | float | complex | str | bytes)


def place_of(function: Callable[..., Any]) -> Function:
    """Return module and qualified name of a function; of `__main__`, the name that it runs by."""
    plain: Any = inspect.unwrap(function)
    space = getattr(plain, "__globals__", {})
    name = getattr(space.get("__spec__"), "name", None) or plain.__module__
    return name, plain.__qualname__


def _global_names(code: CodeType) -> set[str]:
    """Return global names used by a function's code and code nested in it."""
    names = {line.argval for line in dis.get_instructions(code) if line.opname == "LOAD_GLOBAL"}
    inner = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return names.union(*map(_global_names, inner))


@cache
def _files(name: str, folder: Path, suffixes: frozenset[str]) -> tuple[tuple[str, str], ...]:
    """Return paths and hashes of the files of some kinds in and below a package's folder."""
    files = (file for file in folder.rglob("*") if file.suffix in suffixes)
    return tuple(
        (f"{name}/{file.relative_to(folder).as_posix()}", _hash(file.read_bytes()))
        for file in sorted(files)
    )


class OtherCode(RuntimeError):
    """The code of a process differs from that of the calling process."""


@cache
def package_digest(name: str) -> str:
    """Return the hash of all sources and shaders of a package or module; empty if it is missing."""
    spec = place(name)
    folders = list(spec.submodule_search_locations or ()) if spec else []
    found = [file for of in folders for file in _files(name, Path(of), SHADERS | {".py"})]
    if spec and spec.has_location and spec.origin and not folders:
        found = [(name, _hash(Path(spec.origin).read_bytes()))]
    return _hash(repr(found).encode()) if found else ""


def check_code(digests: Mapping[str, str]) -> None:
    """Raise `OtherCode` if the digest of a package differs in this process."""
    if other := [name for name, digest in digests.items() if package_digest(name) != digest]:
        raise OtherCode(f"has other code of {', '.join(other)}; it must have that of this process")


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
