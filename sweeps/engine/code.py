"""Hashes of a function's code: the sources behind it, and the versions of libraries.

A stored result is reused only while this hash is the same, so whatever it omits must not affect
results. Modules are read from their files, without importing anything, as compiled statements:
comments, docstrings, layout, and what is only for types are no part of these. A module counts as a
whole, with all that it imports, unless it uses the engine, as the file of an experiment does: of
that count the statements that bind the names a function uses, in turn, and those that may do more
than bind names.
"""

from __future__ import annotations
import __future__

import ast
import builtins
import dis
import hashlib
import inspect
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import astuple, dataclass, field
from functools import cache, cached_property
from importlib import metadata
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import decode_source, find_spec, resolve_name
from itertools import accumulate
from modulefinder import ModuleFinder
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

from platformdirs import user_cache_path

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.places import Objects

Reference = tuple[str, str]  # a module, and a name looked up in it: "" for none, "*" for all

ENGINE = frozenset({__name__.rpartition(".")[0]})
ABOVE = __name__.partition(".")[0]  # it offers the engine's `sweep`
SOURCES = "sources.json"  # in the user's cache
LABELS = frozenset({"help", "label"})  # arguments of settings that are only shown

_DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
_ANNOTATIONS = __future__.annotations.compiler_flag  # compiled as texts
_FINDER = ModuleFinder()
_IMPORT = dis.opmap["IMPORT_NAME"]
_FOR_TYPES = re.compile(r"\bif (?:typing\.)?TYPE_CHECKING:")


@dataclass
class Statement:
    """A statement at the top of a module, or all of a module, compiled.

    It `acts` if it may do more than bind names, which count where they are used.
    """

    digest: str
    uses: list[str]  # variables and attributes
    imports: list[Reference]
    binds: list[str]
    acts: bool = True

    @classmethod
    def of(cls, source: str | ast.Module, package: str) -> Statement:
        """Return a statement that is compiled now."""
        # Without docstrings (and assertions), and annotations as texts.
        code: CodeType = compile(source, "", "exec", _ANNOTATIONS, dont_inherit=True, optimize=2)
        inside = [*_codes(code)]
        stores = (names for what, names in _FINDER.scan_opcodes(code) if what == "store")
        return cls(
            hashlib.sha256(_text(code).encode()).hexdigest(),
            sorted({name for one in inside for name in one.co_names}),
            sorted({target for one in inside for target in _imports(one, package)}),
            sorted({name for names in stores for name in names}),
        )


class Module:
    """The statements of a module, or only one, if each of them counts.

    `stages` are the names of functions in it that are stages: their decorators only declare.
    """

    def __init__(self, name: str, file: Path, source: bytes, stages: frozenset[str]) -> None:
        is_package = file.name == "__init__.py"
        self.name, self.file = name, file
        self.package = name if is_package else name.rpartition(".")[0]
        self.folder = str(file.parent)
        whole, *apart = _SOURCES.statements(
            (name, self.package, sorted(stages)), source, lambda: self._statements(source, stages)
        )
        self.uses, self.is_lazy = {*whole.uses}, "__getattr__" in whole.binds
        self.is_apart, self.statements = bool(apart), apart or [whole]
        self.bound: dict[str, list[int]] = {}  # numbers of the statements that bind a name
        for number, statement in enumerate(self.statements):
            for local in statement.binds:
                self.bound.setdefault(local, []).append(number)

    def _statements(self, source: bytes, stages: frozenset[str]) -> list[Statement]:
        """Return all of the module, and its statements one by one if it may declare experiments."""
        if self.file.suffix != ".py":  # compiled by another language: it counts as it is
            source = f"source = {_hash(source)!r}".encode()
        text = _FOR_TYPES.sub("if 0:", decode_source(source))
        whole = Statement.of(text, self.package)
        if any(of == ABOVE or within(of, ENGINE) for of, _ in whole.imports):
            return [whole, *self._apart(text, stages)]
        return [whole]

    def _apart(self, text: str, stages: frozenset[str]) -> list[Statement]:
        """Return the statements one by one, without what is only shown."""
        nodes = [*_alone(ast.parse(text).body)]
        for node in nodes:
            if isinstance(node, ast.FunctionDef) and node.name in stages:
                node.decorator_list = []
            for inner in (node, *getattr(node, "body", ())):
                if isinstance(inner, _DEFINITIONS) and _is_text(inner.body[0]):
                    inner.body = inner.body[1:] or [ast.Pass(lineno=1, col_offset=0)]
        statements = [Statement.of(ast.Module([node], []), self.package) for node in nodes]
        owners: dict[str, set[str]] = {}  # by names, the modules that they are imported from
        for node, statement in zip(nodes, statements, strict=True):
            imported = {of for of, _ in statement.imports}
            for name in statement.binds:
                known = imported if isinstance(node, ast.Import | ast.ImportFrom) else {""}
                owners[name] = owners.get(name, set()) | known
        engine = {name for name, known in owners.items() if all(within(of, ENGINE) for of in known)}
        # Those that register nothing as decorators and bases.
        harmless = engine | {name for name, known in owners.items() if all(map(is_standard, known))}
        harmless |= set(dir(builtins)) - owners.keys()
        for number, node in enumerate(nodes):
            if isinstance(node, ast.FunctionDef) and _first_names(node.decorator_list) & engine:
                node.decorator_list = []  # a stage of another experiment
                statements[number] = Statement.of(ast.Module([node], []), self.package)
            if isinstance(node, ast.ClassDef) and _names(node.bases) & engine:
                for call in (getattr(inner, "value", None) for inner in node.body):
                    if isinstance(call, ast.Call):
                        call.keywords = [
                            keyword for keyword in call.keywords if keyword.arg not in LABELS
                        ]
                statements[number] = Statement.of(ast.Module([node], []), self.package)
            statements[number].acts = _acts(node, harmless)
        return statements


def _alone(body: Iterable[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements at the top of a module, imports name by name, without texts."""
    for node in body:
        if isinstance(node, ast.Import):
            yield from (ast.copy_location(ast.Import([name]), node) for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module != "__future__":
            for name in node.names:
                yield ast.copy_location(ast.ImportFrom(node.module, [name], node.level), node)
        elif not (isinstance(node, ast.ImportFrom) or _is_text(node)):
            yield node


def _first_names(decorators: Iterable[ast.expr]) -> set[str]:
    """Return the first name of each of some decorators, such as `a` of `@a.b(c)`."""
    return {re.split(r"\W", ast.unparse(decorator), maxsplit=1)[0] for decorator in decorators}


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _acts(node: ast.stmt, harmless: set[str]) -> bool:
    """Return whether a statement may do more than bind names."""
    match node:
        case ast.ClassDef():
            metaclass = [
                keyword.value for keyword in node.keywords if keyword.arg in {None, "metaclass"}
            ]
            called = _names([*node.decorator_list, *node.bases, *metaclass])
            return not called <= harmless or any(_acts(inner, harmless) for inner in node.body)
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            return not _names(node.decorator_list) <= harmless
        case ast.Assign(targets=targets):
            return not all(map(_is_name, targets))
        case ast.AnnAssign(target=target):
            return not _is_name(target)
        case ast.Import(names=[name]):
            return name.asname is None  # for its effect, or for other modules of the package
        case ast.ImportFrom(names=[name]):
            return name.name == "*"
        case ast.If(test=test):
            return ast.unparse(test) != "__name__ == '__main__'"  # the commands of a script
    return not (isinstance(node, ast.Pass) or _is_text(node))


def _names(expressions: Iterable[ast.expr]) -> set[str]:
    """Return the names of variables in some expressions."""
    inside = (inner for expression in expressions for inner in ast.walk(expression))
    return {inner.id for inner in inside if isinstance(inner, ast.Name)}


def _is_name(target: ast.expr) -> bool:
    if isinstance(target, ast.Tuple):
        return all(map(_is_name, target.elts))
    return isinstance(target, ast.Name)


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield code, and the code nested in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _imports(code: CodeType, package: str) -> Iterator[Reference]:
    """Yield what imports, and calls of `import_module`, in code refer to."""
    imports = _IMPORT in code.co_code[::2]  # most code has none, and a scan takes long
    scanned = _FINDER.scan_opcodes(code) if imports else ()
    found = [given for what, given in scanned if what != "store"]
    for *level, names, name in found:
        owner = _absolute("." * sum(level) + name, package)
        above = accumulate(owner.split("."), "{}.{}".format)
        yield from ((owner, one) for one in names) if names else ((one, "") for one in above)
    if not {"import_module", "__import__"}.isdisjoint(code.co_names):
        texts = (
            constant
            for constant in code.co_consts
            if isinstance(constant, str) and constant.strip(".")
        )
        named = (_absolute(text, package) for text in texts)
        yield from ((name, "") for name in named if place(name) is not None)


def _absolute(name: str, package: str) -> str:
    """Return the absolute name of a module; unchanged if Python would refuse it."""
    try:
        return resolve_name(name, package)
    except ImportError:
        return name


def _text(value: object) -> str:
    """Return a text of compiled code, or of a constant in it; equal for equal ones only."""
    if isinstance(value, CodeType):
        numbers = (value.co_argcount, value.co_posonlyargcount, value.co_kwonlyargcount)
        names = (value.co_name, value.co_names, value.co_varnames, value.co_freevars)
        rest = (value.co_cellvars, value.co_flags, value.co_code, value.co_exceptiontable)
        constants = [*value.co_consts]
        loads = (
            instruction
            for instruction in dis.get_instructions(value)
            if instruction.opname == "LOAD_CONST"
        )
        if "__firstlineno__" in value.co_names and sum(load.arg == 1 for load in loads) == 1:
            constants[1] = None  # the line of a class, which Python keeps from 3.13 on
        return repr((numbers, names, rest, [_text(constant) for constant in constants]))
    if isinstance(value, frozenset):
        return f"frozenset({sorted(map(_text, value))})"
    if isinstance(value, tuple):
        return f"({','.join(map(_text, value))})"
    return repr(value)


@cache
def place(name: str) -> ModuleSpec | None:
    """Return the location of a module, found without importing anything."""
    owner, _, _last = name.rpartition(".")
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


def is_standard(name: str) -> bool:
    """Return whether a module is of Python's own library."""
    return name.partition(".")[0] in sys.stdlib_module_names


def open_module(name: str, file: Path, stages: frozenset[str]) -> Module:
    """Return a module; its file is read again after a change."""
    status = file.stat()
    return _read(name, file, stages, status.st_mtime_ns, status.st_size)


@cache
def _read(name: str, file: Path, stages: frozenset[str], modified: int, size: int) -> Module:
    return Module(name, file, file.read_bytes(), stages)


class _Sources:
    """Statements of modules that were compiled before, in a file of the user's cache.

    They are there by the hash of all that they depend on: compiling takes most of a digest's time.
    """

    def __init__(self) -> None:
        self._objects = Objects(user_cache_path(ABOVE), make=True, mode=0o700, clean=False)
        self._used: dict[str, list[Statement]] = {}
        self._is_new = False

    @cached_property
    def _rules(self) -> str:
        return f"{sys.version} {_hash(Path(__file__).read_bytes())}"

    @cached_property
    def _before(self) -> dict[str, Any]:
        """What the file has; nothing if it is missing, damaged, or another user may write to it."""
        with suppress(OSError, ValueError):
            if not self._objects.foreign([SOURCES]):
                return dict(json.loads(self._objects.get(SOURCES) or b"{}"))
        return {}

    def statements(
        self, of: Sequence[Any], source: bytes, compiled: Callable[[], list[Statement]]
    ) -> list[Statement]:
        """Return the statements of a source, compiled now if they were not before."""
        key = _hash(repr((self._rules, of)).encode() + source)
        try:
            found = [
                Statement(digest, uses, [(a, b) for a, b in imports], binds, acts)
                for digest, uses, imports, binds, acts in self._before[key]
            ]
        except (KeyError, TypeError, ValueError):
            found, self._is_new = compiled(), True
        return self._used.setdefault(key, found)

    def keep(self) -> None:
        """Write the statements that this process uses, if some were compiled in it."""
        if self._is_new:
            self._is_new = False
            used = {key: [astuple(one) for one in found] for key, found in self._used.items()}
            with suppress(OSError):
                self._objects.put(SOURCES, json.dumps(used).encode())


_SOURCES = _Sources()
keep_sources = _SOURCES.keep


# installed libraries ------------------------------------------------------------------------------


@cache
def versions(top: str) -> tuple[tuple[str, str], ...]:
    """Return distributions of a top-level package with versions; empty if it is only a source."""
    names = {owner.metadata["Name"] for owner in distributions().get(top, ())}
    if not names and not _is_there(top):
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


def _is_there(top: str) -> bool:
    try:
        return find_spec(top) is not None
    except ValueError:  # __main__, or a module created at run time
        return False


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
        self._digest = cache(self._find_digest)

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
        return self._digest(function)

    def _find_digest(self, function: Callable[..., Any]) -> CodeDigest:
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
        folders = {(of.package, of.folder) for of in modules.values()}
        shaders = sorted(pair for name, of in folders if name for pair in _files(name, of, SHADERS))
        parts = [place_of(plain), [*map(place_of, functions)], values, code, shaders, libraries]
        digest = _hash(json.dumps(parts, sort_keys=True).encode())
        return CodeDigest(digest, tuple(modules), dict(sorted(libraries.items())))

    def _start(self, function: FunctionType) -> str:
        """Return the name of the module that defines a function, and open it."""
        name, qualified = place_of(function)
        file = Path(function.__globals__.get("__file__") or "")
        if not file.is_file():
            raise ConfigurationError(
                f"function {qualified} of {name} has no source to read: define it in a file"
            )
        self._started.setdefault(name, self._open(name, file))
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
                found.nodes |= {(name, one) for one in of.bound.keys() & statement.uses}
                found.nodes |= {(name, WHOLE)} if ANY_NAME & {*statement.uses} else set()
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
        if of.package != of.name:
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


@cache
def _files(name: str, folder: str, suffixes: frozenset[str]) -> tuple[tuple[str, str], ...]:
    """Return paths and hashes of the files of some kinds in and below a package's folder."""
    files = (file for file in Path(folder).rglob("*") if file.suffix in suffixes)
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
    found = [file for of in folders for file in _files(name, of, SHADERS | {".py"})]
    if spec and spec.has_location and spec.origin and not folders:
        found = [(name, _hash(Path(spec.origin).read_bytes()))]
    return _hash(repr(found).encode()) if found else ""


def check_code(digests: Mapping[str, str]) -> None:
    """Raise `OtherCode` if the digest of a package differs in this process."""
    if other := [name for name, digest in digests.items() if package_digest(name) != digest]:
        raise OtherCode(f"has other code of {', '.join(other)}; it must have that of this process")


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
