"""Hash of the code behind a function: the modules that it imports, and versions of libraries.

A stored result is found again only while this hash is the same, so what it leaves out must not
matter to numbers. Imports are read from the sources, without importing anything. Whole modules are
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
    """Hash of a function's code, and what it was made of."""

    digest: str  # hexadecimal SHA-256; depends on no absolute path and no order of discovery
    modules: tuple[str, ...]  # whose sources count, sorted
    libraries: Mapping[str, str]  # versions of the distributions that count, by name


@dataclass(frozen=True)
class _Module:
    """A module that counts by its source; without a file when it was typed into a session."""

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
    """Hash of a function's name and the code behind it, as it was when this process first asked.

    Parameters
    ----------
    function : callable
        A plain function, decorated or not. Values bound to its closure do not count.
    roots, without : frozenset of str
        Packages and modules, by dotted names, whose sources (and shaders) count, and do not count,
        with all below them. Of other imports outside the standard library the version of the
        distribution counts, or the source when no distribution has it.
    also : tuple of str
        Further distributions whose versions count: those that libraries call unseen.

    Raises
    ------
    ConfigurationError
        If the function has no source to read, or a distribution of `also` is not installed.
    TypeError
        If `function` is no Python function.
    """
    plain = inspect.unwrap(function)
    if not isinstance(plain, FunctionType):
        raise TypeError(f"{function!r} is no Python function")
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
    """A process has other code than the one that asks it."""


@cache
def package_digest(name: str) -> str:
    """Hash of all sources and shaders of a package, or of a module; empty if it is not there."""
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
    """Raise `OtherCode` if a package has another digest in this process."""
    if other := [name for name, digest in digests.items() if package_digest(name) != digest]:
        raise OtherCode(f"has other code of {', '.join(other)}; it must have that of this process")


@cache
def _walk(
    start: _Module, roots: frozenset[str], without: frozenset[str]
) -> tuple[dict[str, str], dict[str, str], frozenset[str]]:
    """Hashes of the modules behind a module and of their data files; libraries they import."""
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
    """Whether a module is one of some packages or below one."""
    return any(f"{name}.".startswith(f"{package}.") for package in packages)


@cache
def _edges(
    module: _Module, roots: frozenset[str], without: frozenset[str]
) -> tuple[frozenset[str], frozenset[str]]:
    """Modules that a module imports and that count by their source; libraries it imports."""
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
    # packages above, whose import does more than define names, as setting a variable
    parts = module.name.split(".")
    for parent in (".".join(parts[:i]) for i in range(1, len(parts))):
        if _within(parent, roots) and (above := _module(parent)) and above.acts:
            modules.add(parent)
    return frozenset(n for n in modules if not _within(n, without)), frozenset(libraries)


def _targets(owner: str, name: str) -> set[str]:
    """Modules behind `from owner import name`: the one of that name, or where the name is."""
    package = _module(owner)
    if name and name != "*" and _place(f"{owner}.{name}") is not None:
        # a package may give the name of one of its modules to something else
        renamed = package is not None and name in package.names
        return {f"{owner}.{name}", owner} if renamed else {f"{owner}.{name}"}
    if package is None:
        return set()
    # made on demand by the package, from which of its modules cannot be read
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
    """The module that defines a function; of one without a file, the function alone."""
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
    """Names that a function's code, and code nested in it, looks up in its module."""
    names = {line.argval for line in dis.get_instructions(code) if line.opname == "LOAD_GLOBAL"}
    inner = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return names.union(*map(_global_names, inner))


def _module(name: str) -> _Module | None:
    """A module read from its file; None when it is not there, or only a folder of modules."""
    place = _place(name)
    return _open(name, place[0]) if place and place[0] else None


def _place(name: str) -> Place | None:
    """Where a module is, found without importing anything."""
    top, *parts = name.split(".")
    try:
        spec = find_spec(top)  # a top-level name: nothing is imported to find it
    except ValueError:  # __main__, or a module made by hand
        return None
    if spec is None:
        return None
    file = Path(spec.origin) if spec.has_location and spec.origin else None
    place: Place | None = (file, tuple(spec.submodule_search_locations or ()))
    for part in parts:
        place = place and _place_in([os.path.join(folder, part) for folder in place[1]])
    return place


def _place_in(paths: list[str]) -> Place | None:
    """As `_place`, of a module at one of some paths, in the order that Python's import looks."""
    for path in paths:
        if os.path.isfile(file := os.path.join(path, "__init__.py")):
            return Path(file), (path,)
        for suffix in (*EXTENSION_SUFFIXES, ".py"):
            if os.path.isfile(path + suffix):
                return Path(path + suffix), ()
    spaces = tuple(filter(os.path.isdir, paths))
    return (None, spaces) if spaces else None


def _data(package: str, folder: Path) -> Iterator[tuple[str, str]]:
    """Paths and hashes of the shaders of a package, those of packages in it left out."""
    for inner, folders, files in os.walk(folder if package else ""):
        folders[:] = [n for n in folders if not os.path.isfile(f"{inner}/{n}/__init__.py")]
        for file in (Path(inner, name) for name in files):
            if file.suffix in DATA_SUFFIXES:
                path = file.relative_to(folder).as_posix()
                yield f"{package}/{path}", hashlib.sha256(file.read_bytes()).hexdigest()


def _open(name: str, file: Path) -> _Module:
    """Read a module, again when its file was written again."""
    status = file.stat()
    return _read(name, file, status.st_mtime_ns, status.st_size)


@cache
def _read(name: str, file: Path, modified: int, size: int) -> _Module:
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    code = file.read_bytes()
    read = _parse(code, package) if file.suffix == ".py" else ()  # else compiled
    return _Module(name, file, package, hashlib.sha256(code).hexdigest(), *read)


def _parse(code: bytes, package: str) -> tuple[frozenset[Reference], frozenset[str], bool]:
    """What a source refers to, names that it binds, whether it does more than define names."""
    tree = ast.parse(code)
    references: set[Reference] = set()
    names: set[str] = set()
    imports: dict[str, set[str]] = {}  # local name: what it may stand for
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
    """Nodes of a source but those for type checkers alone."""
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
    """Local name that an import binds, what to, and what is looked up for it."""
    if isinstance(node, ast.ImportFrom):
        owner = _absolute("." * node.level + (node.module or ""), package)
        return alias.asname or alias.name, f"{owner}.{alias.name}", {(owner, alias.name)}
    if alias.asname:
        return alias.asname, alias.name, {(alias.name, "")}
    parts = alias.name.split(".")
    return parts[0], parts[0], {(".".join(parts[:i]), "") for i in range(1, len(parts) + 1)}


def _called(node: ast.Call, package: str) -> set[Reference]:
    """What `import_module("a.b")` looks up; a name made at run time cannot be read."""
    if node.args and _chain(node.func)[-1] in {"import_module", "__import__"}:
        name = getattr(node.args[0], "value", None)
        return {(_absolute(name, package), "")} if isinstance(name, str) else set()
    return set()


def _absolute(name: str, package: str) -> str:
    """Name of a module without leading dots; as it is where Python would refuse it too."""
    try:
        return resolve_name(name, package)
    except ImportError:
        return name


def _chain(node: ast.expr) -> tuple[str, ...]:
    """Names of `a.b.c`; an empty one first when it begins otherwise than with a name."""
    if isinstance(node, ast.Attribute):
        return (*_chain(node.value), node.attr)
    return (node.id,) if isinstance(node, ast.Name) else ("",)


def _defines(node: ast.stmt) -> bool:
    """Whether a statement at the top of a module only defines names of that module."""
    if isinstance(node, ast.Assign):
        return all(isinstance(target, ast.Name | ast.Tuple) for target in node.targets)
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant)  # a docstring
    if isinstance(node, ast.If):
        return _chain(node.test)[-1] == "TYPE_CHECKING"
    return isinstance(node, (ast.Import, ast.ImportFrom, ast.AnnAssign, *_DEFINITIONS))


@cache
def _versions(top: str) -> tuple[tuple[str, str], ...]:
    """Distributions of a top-level package with versions; none when it is only a source."""
    names = {owner.metadata["Name"] for owner in _distributions().get(top, ())}
    if not names and _place(top) is None:
        return ((top, "not installed"),)
    return tuple((name, metadata.version(name)) for name in sorted(names))


@cache
def _distributions() -> dict[str, list[metadata.Distribution]]:
    """Distributions that have each top-level package.

    As `metadata.packages_distributions`, which is slow and, in Python 3.11, leaves out packages
    that are a single compiled file.
    """
    found: dict[str, list[metadata.Distribution]] = {}
    for owner in metadata.distributions():
        files = owner.read_text("RECORD") or owner.read_text("top_level.txt") or ""
        for top in {name.partition(".")[0] for name in re.findall("^[^/,\n]+", files, re.M)}:
            found.setdefault(top, []).append(owner)
    return found
