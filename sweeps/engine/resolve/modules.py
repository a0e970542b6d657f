"""Hash modules for keys, by their source and imports or by their version.

It imports none of them.
"""

from __future__ import annotations

import ast
import json
import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from importlib import metadata
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec, resolve_name
from itertools import accumulate
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from platformdirs import user_cache_path

from sweeps.engine.declare.paths import is_private
from sweeps.engine.resolve.keys import digest

ENGINE = frozenset({__name__.rpartition(".")[0].rpartition(".")[0]})
SHADERS = frozenset({".vert", ".frag", ".glsl"})
CACHE_FILE, MAX_MODULES = "sources.json", 4000  # how many are kept
CACHE_FOLDER = user_cache_path("sweeps")

Reference = tuple[str, str]  # a module, and a name that is imported from it; "" for none


class Module(NamedTuple):
    """Hash of a module's syntax tree, its imports, and whether it imports on demand."""

    digest: str
    imports: list[Reference]
    is_lazy: bool


def _parse(source: bytes, package: str) -> Module:
    """Parse the source of a module; of compiled files, hash the bytes."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return Module(digest(source), [], False)
    for node in ast.walk(tree):
        match node:
            case ast.If(test=ast.Name("TYPE_CHECKING") | ast.Attribute(attr="TYPE_CHECKING")):
                node.body = []
            case ast.FunctionDef(decorator_list=[]):
                node.returns = None
                for argument in ast.walk(node.args):
                    if isinstance(argument, ast.arg):
                        argument.annotation = None
        if isinstance(body := getattr(node, "body", None), list):
            body[:] = [statement for statement in body if not _is_constant(statement)]
    lazy = any(getattr(statement, "name", "") == "__getattr__" for statement in tree.body)
    return Module(digest(ast.dump(tree)), sorted({*_imports(tree, package)}), lazy)


def _is_constant(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _imports(tree: ast.Module, package: str) -> Iterator[Reference]:
    """Yield the imports of a module, including `import_module` of a constant."""
    for node in ast.walk(tree):
        match node:
            case ast.Import():
                yield from ((alias.name, "") for alias in node.names)
            case ast.ImportFrom():
                owner = absolute_name("." * node.level + (node.module or ""), package)
                yield from ((owner, alias.name) for alias in node.names)
            case ast.Call(ast.Name(name) | ast.Attribute(attr=name), [ast.Constant(str(text)), *_]):
                if name in {"import_module", "__import__"}:
                    yield absolute_name(text, package), ""


def absolute_name(name: str, package: str) -> str:
    """Return the absolute name of a module; unchanged if Python would refuse it."""
    with suppress(ImportError):
        return resolve_name(name, package)
    return name


@cache
def _cached_modules() -> dict[str, Any]:
    """Load the cache of parsed modules, by hash of their source; it saves slow parsing.

    Empty if the file is missing or damaged, or another user may write to its folder.
    """
    with suppress(OSError, TypeError, ValueError):
        if is_private(CACHE_FOLDER):
            return dict(json.loads((CACHE_FOLDER / CACHE_FILE).read_bytes()))
    return {}


_new: dict[str, Module] = {}


def save_parsed_modules() -> None:
    """Add the modules that this process parsed to the user's cache."""
    if _new:
        _cached_modules().update(_new)
        _new.clear()
        with suppress(OSError):
            CACHE_FOLDER.mkdir(0o700, parents=True, exist_ok=True)
            with TemporaryDirectory(dir=CACHE_FOLDER) as folder:
                text = json.dumps(dict([*_cached_modules().items()][-MAX_MODULES:]))
                Path(folder, CACHE_FILE).write_text(text)
                os.replace(Path(folder, CACHE_FILE), CACHE_FOLDER / CACHE_FILE)


@cache
def _parser_digest() -> str:
    """Return a hash of the parser: this file, and Python's version."""
    return digest(sys.version.encode() + Path(__file__).read_bytes())


@cache
def read_module(name: str, file: Path, mtime_ns: int) -> Module:
    """Return the module of a file."""
    source = file.read_bytes()
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    key = digest(repr((_parser_digest(), package, source)))
    if key not in _cached_modules():
        _new[key] = _parse(source, package)
    return _new.get(key) or Module(*_cached_modules()[key])


@cache
def module_spec(name: str) -> ModuleSpec | None:
    """Return the location of a module, found without importing anything."""
    owner = name.rpartition(".")[0]
    with suppress(ValueError, KeyError):  # __main__, or a module created at run time
        folders = package_folders(owner) if owner else []
        return PathFinder.find_spec(name, folders) if owner else find_spec(name)
    return None


def package_folders(name: str) -> list[str]:
    """Return the folders of a package; none of a module."""
    spec = module_spec(name)
    return list(spec.submodule_search_locations or ()) if spec else []


@cache
def package_files(name: str, suffixes: frozenset[str]) -> list[tuple[str, str]]:
    """Return paths and hashes of the files of some kinds in and below a package's folders."""
    return [
        (f"{name}/{file.relative_to(folder).as_posix()}", digest(file.read_bytes()))
        for folder in package_folders(name)
        for file in sorted(Path(folder).rglob("*"))
        if file.suffix in suffixes
    ]


@cache
def dist_versions(top: str) -> dict[str, str]:
    """Return the versions of a top-level package's distributions, by name; empty without any."""
    return {owner.metadata["Name"]: owner.version for owner in distributions().get(top, ())}


@cache
def distributions() -> dict[str, list[metadata.Distribution]]:
    """Return the distributions that provide each top-level package.

    Like `metadata.packages_distributions`, which is slow and, in Python 3.11, omits packages
    that are a single compiled file.
    """
    providers: dict[str, list[metadata.Distribution]] = {}
    for owner in metadata.distributions():
        listed = owner.read_text("RECORD") or owner.read_text("top_level.txt") or ""
        for top in {name.partition(".")[0] for name in re.findall("\n([^/,\n]+)", f"\n{listed}")}:
            providers.setdefault(top, []).append(owner)
    return providers


class Modules:
    """Modules that the packages and modules `roots`, by dotted name, import.

    Modules in the roots, including submodules, count by their source, and so do modules of no
    distribution. Other imports count by version. The engine and the standard library do not count.
    """

    def __init__(self, roots: frozenset[str]) -> None:
        self._roots = roots
        self.module, self.is_source = cache(self._module), cache(self._is_source)
        self.loaded_with, self.imports = cache(self._loaded_with), cache(self._imports)

    def _module(self, name: str) -> Module | None:
        """Return a module; None if it has no file."""
        spec = module_spec(name)
        file = Path(spec.origin) if spec and spec.has_location and spec.origin else None
        return read_module(name, file, file.stat().st_mtime_ns) if file else None

    def _is_source(self, name: str) -> bool:
        """Return whether a module counts by its source."""
        top = name.partition(".")[0]
        if is_within(name, ENGINE) or (top in sys.stdlib_module_names and top not in self._roots):
            return False
        return is_within(name, self._roots) or not dist_versions(top)

    def _loaded_with(self, owner: str, name: str) -> set[str]:
        """Return the source modules, or the library, that importing `name` from `owner` loads."""
        if not self.is_source(owner):
            return set() if is_within(owner, ENGINE) else {owner.partition(".")[0]}
        loaded, module = {*accumulate(owner.split("."), "{}.{}".format)}, self.module(owner)
        if name and module_spec(f"{owner}.{name}"):
            loaded.add(f"{owner}.{name}")
        elif module and module.is_lazy:
            paths = (path for path, _ in package_files(owner, frozenset({".py"})))
            below = [path.removesuffix(".py") for path in paths]
            loaded |= {path.replace("/", ".").removesuffix(".__init__") for path in below}
        return {*filter(self.is_source, loaded)}

    def _imports(self, name: str) -> set[str]:
        """Return all sources and libraries that a module imports."""
        module = self.module(name)
        references = module.imports if module else []
        return set().union(*(self.loaded_with(*reference) for reference in references))


def is_within(name: str, packages: Iterable[str]) -> bool:
    """Return whether a module is in, or is itself, one of some packages."""
    return any(f"{name}.".startswith(f"{package}.") for package in packages)
