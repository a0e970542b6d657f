"""What a function's result depends on, as hashes by name: its code, and the values that it holds.

1. If a `version` is given, that alone.
2. Of a function of a stage's file, a script, a notebook, or made at run time: its instructions, its
   defaults, its closure, and each global that it names, as they are when the sweep begins.
   Functions and classes of such files count by this rule, what comes from other modules, or is
   imported inside, by the next, and any other value by its content (`_Walk.token`).
3. Of a module in `Experiment.code`, or of no distribution: its syntax tree without docstrings,
   comments and what is only for types, and that of all modules that it imports. Of other modules:
   the version of their distribution. Python's own, and the engine, do not count.
4. What has no content to compare, such as an open file or a lock, is refused.
"""

from __future__ import annotations

import ast
import dis
import hashlib
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, cached_property, partial
from importlib import metadata
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec, resolve_name
from itertools import accumulate, islice, takewhile
from pathlib import Path
from types import CodeType, FunctionType, MappingProxyType, MethodType, ModuleType
from typing import Any, NamedTuple

import numpy as np
from platformdirs import user_cache_path

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.places import Objects
from sweeps.engine.settings import Settings
from sweeps.engine.stage import Stage

ENGINE = frozenset({__name__.rpartition(".")[0]})
SOURCES = "sources.json"  # in the user's cache
SHADERS = frozenset({".vert", ".frag", ".glsl"})
MAIN = "__main__"
# Functions that name one of these may reach anything in their file.
ANYTHING = frozenset(
    {"eval", "exec", "globals", "vars", "modules", "__globals__", "__subclasses__"}
)
LABELS = frozenset({"help", "label"})  # of settings: they are only shown
_GLOBALS = frozenset({"LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS"})
_BY_NAME = {*dis.hasname, *dis.haslocal, *dis.hasfree, *dis.hasjrel, *dis.hasjabs}
# What a class in a function says of itself: its text, and its line.
_OF_CLASS = frozenset({"__doc__", "__firstlineno__", "__static_attributes__"})
_ARGUMENTS = 0x3FF  # flags of code: kinds of arguments and of functions
_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(...), type(NotImplemented))

Reference = tuple[str, str]  # a module, and a name imported from it; "" for none


@dataclass(frozen=True)
class CodeDigest:
    """Hash of what a function depends on, with its parts by name and the libraries among them."""

    digest: str  # hexadecimal SHA-256; depends on no absolute path and no order of discovery
    parts: Mapping[str, str]
    libraries: Mapping[str, str]  # versions of distributions


# modules ------------------------------------------------------------------------------------------


class Module(NamedTuple):
    """Hash of a module's syntax tree, what it imports, and whether it imports on demand."""

    digest: str
    imports: list[Reference]
    is_lazy: bool

    @classmethod
    def of(cls, source: bytes, package: str) -> Module:
        """Return a module by its source."""
        tree = ast.parse(source)
        for node in ast.walk(tree):
            if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
                is_not = isinstance(node.test, ast.UnaryOp)
                node.body = node.body if is_not else []
                node.orelse = [] if is_not else node.orelse
            if isinstance(node, ast.FunctionDef) and not node.decorator_list:
                node.returns = None
                for one in ast.walk(node.args):
                    if isinstance(one, ast.arg):
                        one.annotation = None
            if isinstance(body := getattr(node, "body", None), list):
                node.body = [one for one in body if not _is_text(one)]
        lazy = any(
            isinstance(one, ast.FunctionDef) and one.name == "__getattr__" for one in tree.body
        )
        return cls(_hash(ast.dump(tree)), sorted({*_imports(tree, package)}), lazy)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _imports(tree: ast.Module, package: str) -> Iterator[Reference]:
    """Yield what a module imports anywhere, also by `import_module` of a text."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((one.name, "") for one in node.names)
        elif isinstance(node, ast.ImportFrom):
            owner = _absolute("." * node.level + (node.module or ""), package)
            yield from ((owner, one.name) for one in node.names)
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            name = ast.unparse(node.func).rpartition(".")[2]
            if name in {"import_module", "__import__"}:
                yield _absolute(str(node.args[0].value), package), ""


def _absolute(name: str, package: str) -> str:
    """Return the absolute name of a module; unchanged if Python would refuse it."""
    try:
        return resolve_name(name, package)
    except ImportError:
        return name


class _Sources:
    """Modules that were read before, by the hash of their source, in a file of the user's cache.

    Parsing takes most of a digest's time.
    """

    def __init__(self) -> None:
        self._objects = Objects(user_cache_path("sweeps"), make=True, mode=0o700, clean=False)
        self._used: dict[str, Module] = {}
        self._is_new = False

    @cached_property
    def _before(self) -> dict[str, Any]:
        """What the file has; nothing if it is missing, damaged, or another user may write to it."""
        with suppress(OSError, ValueError):
            if not self._objects.foreign([SOURCES]):
                return dict(json.loads(self._objects.get(SOURCES) or b"{}"))
        return {}

    @cached_property
    def _rules(self) -> str:
        return f"{sys.version} {_hash(Path(__file__).read_bytes())}"

    def module(self, source: bytes, package: str) -> Module:
        """Return the module of a source, parsed now if it was not before."""
        key = _hash(f"{self._rules} {package} ".encode() + source)
        try:
            digest, imports, is_lazy = self._before[key]
            found = Module(digest, [(owner, name) for owner, name in imports], is_lazy)
        except (KeyError, TypeError, ValueError):
            found, self._is_new = Module.of(source, package), True
        return self._used.setdefault(key, found)

    def keep(self) -> None:
        """Write the modules that this process uses, if some were parsed in it."""
        if self._is_new:
            self._is_new = False
            with suppress(OSError):
                self._objects.put(SOURCES, json.dumps(self._used).encode())


_SOURCES = _Sources()
keep_sources = _SOURCES.keep


@cache
def _read(name: str, file: Path, modified: int) -> Module:
    """Return the module of a file; one compiled by another language counts as it is."""
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    source = file.read_bytes()
    return (
        _SOURCES.module(source, package)
        if file.suffix == ".py"
        else Module(_hash(source), [], False)
    )


@cache
def place(name: str) -> ModuleSpec | None:
    """Return the location of a module, found without importing anything."""
    owner = name.rpartition(".")[0]
    try:
        if not owner:
            return find_spec(name)
        above = place(owner)
        folders = above.submodule_search_locations if above else None
        return PathFinder.find_spec(name, [*folders]) if folders else None
    except ValueError:  # __main__, or a module created at run time
        return None


def within(name: str, packages: Iterable[str]) -> bool:
    """Return whether a module is in, or is itself, one of some packages."""
    return any(f"{name}.".startswith(f"{package}.") for package in packages)


@cache
def versions(top: str) -> tuple[tuple[str, str], ...]:
    """Return distributions of a top-level package with versions; empty if it is only a source."""
    names = {owner.metadata["Name"] for owner in distributions().get(top, ())}
    if not names and top != MAIN and place(top) is None and top not in sys.modules:
        return ((top, "not installed"),)
    return tuple((name, metadata.version(name)) for name in sorted(names))


@cache
def distributions() -> dict[str, list[metadata.Distribution]]:
    """Return the distributions that provide each top-level package.

    Like `metadata.packages_distributions`, which is slow and, in Python 3.11, omits packages
    that are a single compiled file.
    """
    found: dict[str, list[metadata.Distribution]] = {}
    for owner in metadata.distributions():
        files = owner.read_text("RECORD") or owner.read_text("top_level.txt") or ""
        for top in {name.partition(".")[0] for name in re.findall("\n([^/,\n]+)", f"\n{files}")}:
            found.setdefault(top, []).append(owner)
    return found


@cache
def _files(name: str, folder: str, suffixes: frozenset[str]) -> tuple[tuple[str, str], ...]:
    """Return paths and hashes of the files of some kinds in and below a package's folder."""
    files = (file for file in Path(folder).rglob("*") if file.suffix in suffixes)
    return tuple(
        (f"{name}/{file.relative_to(folder).as_posix()}", _hash(file.read_bytes()))
        for file in sorted(files)
    )


class Code:
    """What functions depend on.

    Parameters
    ----------
    roots : frozenset of str
        Packages and modules, by dotted names, whose sources (and shaders) count, with all below
        them but the engine. Of other imports outside the standard library the version of the
        distribution counts, or the source when no distribution has it.
    homes : frozenset of str
        Modules of which functions, classes and values count one by one.
    """

    def __init__(self, roots: frozenset[str], homes: frozenset[str] = frozenset()) -> None:
        self._roots, self.homes = roots, homes | {MAIN}
        self._known: dict[int, tuple[Any, CodeDigest]] = {}
        self.kind, self.module = cache(self._kind), cache(self._module)
        self.reached, self.edges = cache(self._reached), cache(self._edges)

    def digest(self, function: Callable[..., Any], version: str = "") -> CodeDigest:
        """Return the hash of what a function depends on, or of a version instead.

        Raises
        ------
        ConfigurationError
            If it holds what has no content to compare.
        """
        if version:
            parts = {"version": version}
            return CodeDigest(_hash(repr([place_of(function), version])), parts, {})
        if id(function) not in self._known:
            walk = _Walk(self, function)
            libraries = dict(sorted(pair for top in walk.tops for pair in versions(top)))
            content = json.dumps([walk.root, walk.parts, libraries], sort_keys=True)
            self._known[id(function)] = function, CodeDigest(_hash(content), walk.parts, libraries)
        return self._known[id(function)][1]

    def _module(self, name: str) -> Module | None:
        spec = place(name)
        file = Path(spec.origin) if spec and spec.has_location and spec.origin else None
        return _read(name, file, file.stat().st_mtime_ns) if file else None

    def _kind(self, name: str) -> str:
        """Return whether a module counts by its source, as a library, or not at all."""
        top = name.partition(".")[0]
        if within(name, ENGINE):
            return ""
        if within(name, self._roots):
            return "source"
        if top in sys.stdlib_module_names:
            return ""
        return "library" if versions(top) else "source"

    def _reached(self, owner: str, name: str) -> set[str]:
        """Return sources and libraries that are loaded with a module, or a name of it."""
        kind = self.kind(owner)
        if kind != "source":
            return {owner.partition(".")[0]} if kind else set()
        found = {*accumulate(owner.split("."), "{}.{}".format)}
        inner, module = f"{owner}.{name}", self.module(owner)
        if name and place(inner):
            found.add(inner)
        elif module and module.is_lazy and name != "*":
            spec = place(owner)
            for folder in (spec and spec.submodule_search_locations) or ():
                for file in Path(folder).rglob("*.py"):
                    parts = file.relative_to(folder).with_suffix("").parts
                    found.add(".".join((owner, *parts)).removesuffix(".__init__"))
        return {one for one in found if self.kind(one) == "source"}

    def _edges(self, name: str) -> set[str]:
        module = self.module(name)
        return set().union(*(self.reached(*one) for one in module.imports)) if module else set()


# functions and values -----------------------------------------------------------------------------


class _Scan(NamedTuple):
    """The instructions of code as text, the globals with their attributes, and the imports."""

    text: str
    chains: list[tuple[str, ...]]
    imports: list[tuple[str, str]]  # with the dots of relative ones
    names: frozenset[str]


@cache
def _scan(code: CodeType) -> _Scan:
    """Return what code does: no docstrings, no lines."""
    lines = [repr((code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount))]
    lines += [repr((code.co_varnames, code.co_cellvars, code.co_freevars))]
    lines += [repr((code.co_flags & _ARGUMENTS, code.co_exceptiontable))]
    inner = [_scan(one) for one in code.co_consts if isinstance(one, CodeType)]
    chains = [chain for one in inner for chain in one.chains]
    imports = [target for one in inner for target in one.imports]
    steps = [*dis.get_instructions(code)]
    for number, step in enumerate(steps):
        if step.opname == "STORE_NAME" and step.argval in _OF_CLASS:
            lines.pop()
            continue
        if step.opcode in dis.hasconst:
            argument = _constant(step.argval)
        else:
            argument = repr(step.argval if step.opcode in _BY_NAME else step.arg)
        lines.append(f"{step.opname} {argument}")
        if step.opname in _GLOBALS:
            after = takewhile(
                lambda one: one.opname in _ATTRIBUTES, islice(steps, number + 1, None)
            )
            chains.append((step.argval, *(one.argval for one in after)))
        elif step.opname == "IMPORT_NAME":
            target = "." * steps[number - 2].argval + step.argval
            imports.append((target, ""))
        elif step.opname == "IMPORT_FROM":
            imports.append((target, step.argval))
    names = frozenset(code.co_names).union(*(one.names for one in inner))
    return _Scan("\n".join(lines), chains, imports, names)


_ATTRIBUTES = frozenset({"LOAD_ATTR", "LOAD_METHOD"})


def _constant(value: Any) -> str:
    """Return the text of a constant in code."""
    if isinstance(value, CodeType):
        return f"code {_scan(value).text}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_constant, value))})"
    if isinstance(value, frozenset):
        return f"{{{', '.join(sorted(map(_constant, value)))}}}"
    return f"{type(value).__name__} {value!r}"


class _Walk:
    """The parts of what one function depends on: hashes by name, and libraries."""

    def __init__(self, code: Code, root: Callable[..., Any]) -> None:
        self._code, self._homes = code, code.homes | {place_of(root)[0]}
        self.parts: dict[str, str] = {}
        self.tops: set[str] = set()
        self._labels: dict[int, str] = {}
        self._counts: dict[str, int] = {}
        self._open: list[int] = []
        self._tokens: dict[int, str] = {}
        self._alive: list[Any] = []  # what ids stand for
        self._loaded: set[str] = set()
        self._waiting: list[tuple[str, Any]] = []
        self.root = self._variable(place_of(root)[1], root)
        for label, one in self._waiting:  # which grows
            parts = self._class(label, one) if isinstance(one, type) else self._function(label, one)
            self.parts[f"code of {label}"] = _hash(repr(parts))

    def _label(self, one: Any, name: str) -> str:
        """Return the name of a function, class or file; the second of a name has a number."""
        if id(one) not in self._labels:
            self._alive.append(one)
            number = self._counts[name] = self._counts.get(name, 0) + 1
            self._labels[id(one)] = name if number == 1 else f"{name} {number}"
            if isinstance(one, FunctionType | type):
                self._waiting.append((self._labels[id(one)], one))
        return self._labels[id(one)]

    def _variable(self, name: str, value: Any) -> str:
        """Return what a variable counts by: its name if its value is a part, or what it refers to.

        Raises ConfigurationError if there is no content to compare.
        """
        self._name, self._value = name, value
        token = self.token(value)
        if isinstance(value, FunctionType | type | ModuleType):
            return token
        self.parts[name] = _hash(token)
        return name

    def _function(self, label: str, function: FunctionType) -> list[Any]:
        """Return what is in a function's own part: its code, and what its variables refer to."""
        code, space = function.__code__, function.__globals__
        module = space.get("__name__", "")
        if module == "functools" and hasattr(function, "registry"):  # by type of an argument
            return [self._variable(f"registry of {label}", function.registry)]
        defaults, named = function.__defaults__ or (), function.__kwdefaults__ or {}
        held = dict(
            zip(code.co_varnames[code.co_argcount - len(defaults) :], defaults, strict=False)
        )
        held |= named
        for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            with suppress(ValueError):  # an empty cell
                held[name] = cell.cell_contents
        held |= vars(function)
        found = [
            (name, self._variable(f"{name} of {label}", one)) for name, one in sorted(held.items())
        ]
        if self._is_elsewhere(function, module):
            return found
        scan, before = _scan(code), self._label(space, module)
        package = str(space.get("__package__") or module.rpartition(".")[0])
        for owner, name in scan.imports:
            self._load(_absolute(owner, package), name)
        if ANYTHING & scan.names:
            self._whole(label, space)
        for first, *attributes in sorted({*scan.chains}):
            if first in space:
                path, value = self._resolved(first, space[first], attributes)
                found.append((path, self._variable(f"{before}.{path}", value)))
        return [scan.text, *found]

    def _resolved(self, path: str, value: Any, attributes: list[str]) -> tuple[str, Any]:
        """Return a global, or what it leads to in modules and settings, with its path."""
        for name in attributes:
            of_module = (
                isinstance(value, ModuleType) and self._code.kind(value.__name__) == "source"
            )
            if not of_module and not (isinstance(value, type) and issubclass(value, Settings)):
                break
            inner = vars(value).get(name)
            plain = not isinstance(inner, FunctionType | type | ModuleType)
            if inner is None or (of_module and plain and value.__name__ not in self._homes):
                break
            path, value = f"{path}.{name}", inner
        return path, value

    def _class(self, label: str, one: type) -> list[Any]:
        """Return what is in a class's own part: its bases, methods and values."""
        self._name, self._value = label, one
        found: list[Any] = [self.token(base) for base in (type(one), *one.__bases__)]
        functions = FunctionType | property | staticmethod | classmethod
        for name, value in sorted(vars(one).items()):
            if isinstance(value, functions) or not (name.startswith("__") or name == "_abc_impl"):
                found.append((name, self.token(value)))
        return found

    def _whole(self, label: str, space: Mapping[str, Any]) -> None:
        """Count all of the file of a function that may reach anything there."""
        name, file = space.get("__name__", ""), Path(space.get("__file__") or "")
        if file.suffix != ".py" or not file.is_file():
            raise ConfigurationError(
                f"{label} uses eval, vars or the like, which may reach anything: name what it uses, "
                f"{REMEDY}"
            )
        module = _read(name, file, file.stat().st_mtime_ns)
        self.parts[f"code of {name}"] = module.digest
        for target in module.imports:
            self._load(*target)

    def _load(self, owner: str, name: str = "") -> None:
        """Count a module, or what is imported from it, with all that it imports."""
        waiting = [*self._code.reached(owner, name)]
        for one in waiting:  # which grows
            if one in self._loaded:
                continue
            self._loaded.add(one)
            if self._code.kind(one) == "library":
                self.tops.add(one)
                continue
            if module := self._code.module(one):
                self.parts[f"code of {one}"] = module.digest
            spec = place(one)
            for folder in (spec and spec.submodule_search_locations) or ():
                if "." not in one and (found := _files(one, folder, SHADERS)):
                    self.parts[f"shaders of {one}"] = _hash(repr(found))
            waiting += self._code.edges(one)

    def _is_elsewhere(self, one: FunctionType | type, module: str) -> bool:
        """Return whether a function or class counts by its module."""
        if module in self._homes or module not in sys.modules:
            return False
        if isinstance(one, FunctionType):
            return vars(sys.modules[module]) is one.__globals__
        return self._code.kind(module) != "source" or _found(module, one.__qualname__) is one

    def _reference(self, one: Any) -> str:
        """Return the name of a function, class or module, which counts on its own."""
        if isinstance(one, ModuleType):
            if one.__name__ == MAIN:
                self._whole(self._name, vars(one))
            self._load(one.__name__)
            return f"module {one.__name__}"
        module = (
            one.__globals__.get("__name__", "") if isinstance(one, FunctionType) else one.__module__
        )
        if self._is_elsewhere(one, module):
            self._load(module)
            if isinstance(one, type) or _found(module, one.__qualname__) is one:
                return f"{module}.{one.__qualname__}"
        return self._label(one, f"{module}.{one.__qualname__}")

    def token(self, value: Any) -> str:
        """Return a text that is equal for values of equal type and content."""
        if type(value) in _PLAIN:
            return f"{type(value).__name__} {value!r}"
        if isinstance(value, FunctionType | type | ModuleType):
            return self._reference(value)
        if id(value) in self._open:
            return f"circle {len(self._open) - self._open.index(id(value))}"
        if id(value) not in self._tokens:
            self._alive.append(value)
            self._open.append(id(value))
            try:
                content = self._content(value)
            except ConfigurationError:
                raise
            except Exception as error:
                verb = "is" if value is self._value else "holds"
                raise ConfigurationError(
                    f"{self._name} {verb} a {type(value).__name__}, which has no content to "
                    f"compare: hold its values instead, {REMEDY}"
                ) from error
            finally:
                self._open.pop()
            self._tokens[id(value)] = f"{type(value).__name__} {_hash(repr(content))}"
        return self._tokens[id(value)]

    def _content(self, value: Any) -> Any:
        """Return tokens of what a value consists of; any error if it has no content."""
        kind = type(value)
        if isinstance(value, Stage):
            return self.token(value.function)
        if kind in (list, tuple):
            return [self.token(one) for one in value]
        if kind in (set, frozenset):
            return sorted(self.token(one) for one in value)
        if kind in (dict, MappingProxyType):
            return self._items(value)
        if kind in (property, staticmethod, classmethod, cached_property):
            return [self.token(getattr(value, name, None)) for name in _DESCRIBED]
        if kind is np.ndarray:
            content = value.tolist() if value.dtype.hasobject else value.tobytes()
            return repr(value.dtype), value.shape, self.token(content)
        if within(kind.__module__, ENGINE) and is_dataclass(value):
            names = [one.name for one in fields(value) if one.name not in LABELS]
            return self.token(kind), [(name, self.token(getattr(value, name))) for name in names]
        if hasattr(kind, "__dask_tokenize__"):
            from dask.base import tokenize  # takes long

            return tokenize(value, ensure_deterministic=True)
        if hasattr(value, "py_func") and hasattr(value, "targetoptions"):  # compiled by numba
            return self.token(value.py_func), self.token(value.targetoptions)
        reduced = value.__reduce_ex__(4)
        if isinstance(reduced, str):
            self._load(getattr(value, "__module__", None) or kind.__module__)
            return reduced, self.token(getattr(value, "__wrapped__", None))
        make, arguments, state, items, pairs, *_ = (*reduced, None, None, None)
        if isinstance(state, dict):  # without what was computed from the rest
            state = {k: v for k, v in state.items() if not _is_cache(getattr(kind, str(k), None))}
        parts = [self.token(one) for one in (make, arguments, state)]
        return parts, [self.token(one) for one in items or ()], self._items(dict(pairs or ()))

    def _items(self, given: Mapping[Any, Any]) -> list[tuple[str, str]]:
        """Return tokens of a mapping, whose order does not count."""
        keys = sorted((self.token(key), number) for number, key in enumerate(given))
        values = [*given.values()]
        return [(key, self.token(values[number])) for key, number in keys]


_DESCRIBED = ("fget", "fset", "fdel", "__func__", "func")
REMEDY = "or give version='1', which counts instead of code, and change it with the function"


def _is_cache(value: object) -> bool:
    return isinstance(value, cached_property)


def _found(module: str, name: str) -> Any:
    """Return what a module that is imported has by a dotted name."""
    found: Any = sys.modules[module]
    for part in name.split("."):
        found = getattr(found, part, None)
    return found


def place_of(function: Callable[..., Any]) -> tuple[str, str]:
    """Return module and qualified name of what is called in the end."""
    given: Any = function
    while True:
        inner = given.func if isinstance(given, partial) else getattr(given, "__wrapped__", None)
        inner = given.__func__ if isinstance(given, MethodType) else inner
        if inner is None:
            break
        given = inner
    space = getattr(given, "__globals__", {})
    given = given if hasattr(given, "__qualname__") else type(given)
    return str(space.get("__name__") or given.__module__), given.__qualname__


# the code of other processes ----------------------------------------------------------------------


class OtherCode(RuntimeError):
    """The code of a process differs from that of the calling process."""


@cache
def package_digest(name: str) -> str:
    """Return the hash of all sources and shaders of a package or module; empty if it is missing."""
    spec = place(name)
    folders = list(spec.submodule_search_locations or ()) if spec else []
    found = [file for of in folders for file in _files(name, of, SHADERS | {".py"})]
    if spec and spec.has_location and spec.origin and not folders:
        found = [(name, _hash(Path(spec.origin).read_bytes()))]
    return _hash(repr(found)) if found else ""


def check_code(digests: Mapping[str, str]) -> None:
    """Raise `OtherCode` if the digest of a package differs in this process."""
    if other := [name for name, digest in digests.items() if package_digest(name) != digest]:
        raise OtherCode(f"has other code of {', '.join(other)}; it must have that of this process")


def _hash(data: bytes | str) -> str:
    return hashlib.sha256(data.encode() if isinstance(data, str) else data).hexdigest()
