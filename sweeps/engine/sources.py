"""Modules as compiled statements, read from their files without importing anything; libraries.

Comments, docstrings, layout, and what is only for types are no part of a statement.
"""

from __future__ import annotations
import __future__

import ast
import builtins
import dis
import hashlib
import re
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import metadata
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import decode_source, find_spec, resolve_name
from itertools import accumulate
from modulefinder import ModuleFinder
from pathlib import Path
from types import CodeType

Reference = tuple[str, str]  # a module, and a name looked up in it: "" for none, "*" for all

ENGINE = frozenset({__name__.rpartition(".")[0]})
ABOVE = __name__.partition(".")[0]  # it offers the engine's `sweep`
LABELS = frozenset({"help", "label"})  # arguments of settings that are only shown

_ANNOTATIONS = __future__.annotations.compiler_flag  # compiled as texts
_DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
_FINDER = ModuleFinder()
_FOR_TYPES = re.compile(r"\bif (?:typing\.)?TYPE_CHECKING:")


class Statement:
    """A statement at the top of a module, or all of a module, compiled.

    It `acts` if it may do more than bind names, which count where they are used.
    """

    def __init__(self, source: str | ast.Module, package: str) -> None:
        # Without docstrings (and assertions), and annotations as texts.
        code: CodeType = compile(source, "", "exec", _ANNOTATIONS, dont_inherit=True, optimize=2)
        inside = [*_codes(code)]
        self.digest = hashlib.sha256(_text(code).encode()).hexdigest()
        self.uses = {name for one in inside for name in one.co_names}  # variables and attributes
        self.imports = {target for one in inside for target in _imports(one, package)}
        found = _FINDER.scan_opcodes(code)
        self.binds = {name for what, names in found if what == "store" for name in names}
        self.acts = True


class Module:
    """The statements of a module, or only one, if each of them counts.

    `stages` are the names of functions in it that are stages: their decorators only declare.
    """

    def __init__(self, name: str, file: Path | None, text: str, stages: frozenset[str]) -> None:
        is_package = file is not None and file.name == "__init__.py"
        self.name, self.file = name, file
        self.package = name if is_package else name.rpartition(".")[0]
        text = _FOR_TYPES.sub("if 0:", text)
        whole = Statement(text, self.package)
        self.uses, self.is_lazy = whole.uses, "__getattr__" in whole.binds
        # Whether statements count one by one, since it may declare an experiment.
        self.is_apart = any(of == ABOVE or within(of, ENGINE) for of, _ in whole.imports)
        self.statements = self._apart(text, stages) if self.is_apart else [whole]
        self.bound: dict[str, list[int]] = {}  # numbers of the statements that bind a name
        for number, statement in enumerate(self.statements):
            for local in statement.binds:
                self.bound.setdefault(local, []).append(number)

    def _apart(self, text: str, stages: frozenset[str]) -> list[Statement]:
        """Return the statements one by one, without what is only shown."""
        nodes = [*_alone(ast.parse(text).body)]
        for node in nodes:
            if isinstance(node, ast.FunctionDef) and node.name in stages:
                node.decorator_list = []
            for inner in (node, *getattr(node, "body", ())):
                if isinstance(inner, _DEFINITIONS) and _is_text(inner.body[0]):
                    inner.body = inner.body[1:] or [ast.Pass(lineno=1, col_offset=0)]
        statements = [Statement(ast.Module([node], []), self.package) for node in nodes]
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
                statements[number] = Statement(ast.Module([node], []), self.package)
            if isinstance(node, ast.ClassDef) and _names(node.bases) & engine:
                for call in (getattr(inner, "value", None) for inner in node.body):
                    if isinstance(call, ast.Call):
                        call.keywords = [
                            keyword for keyword in call.keywords if keyword.arg not in LABELS
                        ]
                statements[number] = Statement(ast.Module([node], []), self.package)
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
    found = [given for what, given in _FINDER.scan_opcodes(code) if what != "store"]
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
    source = file.read_bytes()
    if file.suffix == ".py":
        return Module(name, file, decode_source(source), stages)
    # Compiled by another language: it counts as it is.
    return Module(name, file, f"source = {hashlib.sha256(source).hexdigest()!r}", stages)


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
