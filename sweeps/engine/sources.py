"""Sources of modules, found and read without importing anything, statement by statement.

The syntax of a statement is compared as Python compiles it: without comments, docstrings, positions
and layout.
"""

from __future__ import annotations
import __future__

import ast
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec, resolve_name
from pathlib import Path
from types import CodeType
from typing import Any

Reference = tuple[str, str]  # a module, and a name looked up in it: "" for none, "*" for all
Chain = tuple[str, ...]  # the names of `a.b.c`
Place = tuple[Path | None, tuple[str, ...]]  # a module's file, and folders of modules below it

ANY_NAME = frozenset({"eval", "exec", "globals", "vars"})  # whose use may reach any name
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_ASSIGNMENTS = (ast.Assign, ast.AnnAssign)
_SIMPLE = (*_ASSIGNMENTS, ast.AugAssign, ast.Expr)
MAKING = frozenset({"__init__", "__new__", "__post_init__"})  # methods that change a new object
_BY_NAME = (b"import_module", b"__import__")
_PASS = ast.Pass(lineno=1, end_lineno=1, col_offset=0, end_col_offset=0)
_UNPLACED = frozenset({type(None), str, int, ast.Load, ast.Store, ast.Del})
_PLACED = frozenset(
    one
    for one in vars(ast).values()
    if isinstance(one, type) and "lineno" in getattr(one, "_attributes", ())
)


@dataclass(frozen=True)
class Uses:
    """What a statement uses, with the parts of its syntax that may not count."""

    chains: frozenset[Chain]
    imports: dict[str, set[Reference]]  # inside it: local name, and what it refers to
    references: frozenset[Reference]  # of modules imported inside it
    modules: frozenset[Reference]  # that it imports by a text
    documented: tuple[Any, ...]  # nodes with a docstring
    calls: tuple[ast.Call, ...]


class Statement:
    """One statement at the top of a module that is not an import."""

    def __init__(self, node: ast.stmt, package: str, flags: int) -> None:
        self.node = node
        self.defines = isinstance(node, DEFINITIONS)
        # A script's own commands, of which only the names matter that they bind.
        self.is_script = isinstance(node, ast.If) and _is_main(node)
        self.assigns = isinstance(node, _ASSIGNMENTS) and all(
            isinstance(one, ast.Name | ast.Tuple) for one in _targets(node)
        )
        self._package = package
        self._flags = flags

    @cached_property
    def names(self) -> frozenset[str]:
        """Names that it binds, and names bound inside it."""
        if isinstance(self.node, DEFINITIONS):
            return frozenset({self.node.name})
        found = set()
        for node in ast.walk(self.node):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store | ast.Del):
                found.add(node.id)
            elif isinstance(node, DEFINITIONS):
                found.add(node.name)
        return frozenset(found)

    @property
    def decorators(self) -> list[ast.expr]:
        """Decorators of a definition."""
        return getattr(self.node, "decorator_list", [])

    @cached_property
    def used_by_calls(self) -> set[Chain]:
        """Names used where an import of the module calls something; none if it calls nothing."""
        nodes: list[ast.AST] = [self.node]
        if isinstance(self.node, FUNCTIONS):
            given = self.node.args
            nodes = [one for one in (*given.defaults, *given.kw_defaults) if one is not None]
        elif isinstance(self.node, ast.AnnAssign):
            nodes = [self.node.value] if self.node.value else []
        run = [one for node in nodes for one in executed(node)]
        return {
            names
            for one in run
            if isinstance(one, ast.Attribute | ast.Name) and (names := chain(one))[0]
            if any(isinstance(other, ast.Call) for other in run)
        }

    @cached_property
    def calls(self) -> set[Chain]:
        """Names of what it calls when it is called itself."""
        nodes: list[ast.AST] = [self.node]
        if isinstance(self.node, ast.ClassDef):  # to make an object
            nodes = [one for one in self.node.body if getattr(one, "name", "") in MAKING]
        found = (one for node in nodes for one in ast.walk(node) if isinstance(one, ast.Call))
        return {chain(one.func) for one in found}

    @cached_property
    def assigns_inside(self) -> bool:
        """Whether an import of the module assigns to an attribute or element inside it."""
        return any(
            isinstance(one, ast.Attribute | ast.Subscript) and not isinstance(one.ctx, ast.Load)
            for one in executed(self.node)
        )

    @cached_property
    def uses(self) -> Uses:
        """What it uses, wherever inside it. Its positions are forgotten."""
        chains: set[Chain] = set()
        imports: dict[str, set[Reference]] = {}
        references: set[Reference] = set()
        modules: set[Reference] = set()
        documented, calls = [], []
        waiting: list[tuple[Any, bool]] = [(self.node, True)]  # and whether it counts
        while waiting:  # much of the time of a start: nodes are taken apart by hand
            node, counts = waiting.pop()
            kind = type(node)
            if kind in _UNPLACED:
                continue
            if kind in _PLACED:
                node.lineno = node.end_lineno = 1
                node.col_offset = node.end_col_offset = 0
            inside = counts
            if kind is ast.Constant:
                continue
            if not counts:
                pass
            elif kind is ast.Name:
                chains.add((node.id,))
                continue
            elif kind is ast.Attribute:
                if (names := chain(node))[0]:
                    chains.add(names)
                    inside = False
            elif kind is ast.Call:
                modules |= called(node, self._package)
                calls.append(node)
            elif kind is ast.Import or kind is ast.ImportFrom:
                for alias in node.names:
                    local, target, found = imported(node, alias, self._package)
                    imports.setdefault(local, set()).add(target)
                    references |= found
            elif kind is ast.Global:
                chains |= {(name,) for name in node.names}
            elif kind in DEFINITIONS and _is_text(node.body[0]):
                documented.append(node)
            elif kind is ast.If and _is_for_types(node):
                waiting += [(one, False) for one in (node.test, *node.body)]
                waiting += [(one, True) for one in node.orelse]
                continue
            for name in node._fields:
                value = getattr(node, name, None)
                if type(value) is list:
                    waiting += [(one, inside) for one in value]
                else:
                    waiting.append((value, inside))
        return Uses(
            frozenset(chains),
            imports,
            frozenset(references),
            frozenset(modules),
            tuple(documented),
            tuple(calls),
        )

    def compiled(
        self, declares: Callable[[ast.expr], bool], plain: Callable[[ast.Call], ast.Call]
    ) -> str:
        """Return a text of what it compiles to.

        Without the decorators that only declare, and with calls as `plain` returns them.
        """
        uses = self.uses
        changed: list[tuple[Any, str, Any]] = [
            (one, "body", one.body[1:] or [_PASS]) for one in uses.documented
        ]
        if self.defines:
            kept = [one for one in self.decorators if not declares(one)]
            changed.append((self.node, "decorator_list", kept))
        for call in uses.calls:
            if (other := plain(call)) is not call:
                changed += [(call, "args", other.args), (call, "keywords", other.keywords)]
        before = [(node, name, getattr(node, name)) for node, name, _ in changed]
        try:
            for node, name, value in changed:
                setattr(node, name, value)
            module = ast.Module([self.node], [])
            code = compile(module, "", "exec", self._flags, dont_inherit=True, optimize=0)
        finally:
            for node, name, value in before:
                setattr(node, name, value)
        return _text(code)


class Module:
    """A module, read from a file, or typed into an interactive session and then without one."""

    def __init__(self, name: str, file: Path | None, package: str, source: bytes) -> None:
        self.name, self.file, self.package, self.source = name, file, package, source
        self.folder = file and file.parent
        self.is_python = file is None or file.suffix == ".py"
        self.statements: list[Statement] = []
        self.bound: dict[str, list[int]] = {}  # name: statements that bind it
        self.imports: dict[str, set[Reference]] = {}
        self.references: set[Reference] = set()
        if self.is_python:
            self._parse()

    @property
    def names(self) -> set[str]:
        """Names bound at its top."""
        return self.bound.keys() | self.imports.keys()

    def _parse(self) -> None:
        tree = ast.parse(self.source)
        later = any(
            isinstance(node, ast.ImportFrom)
            and node.module == "__future__"
            and any(alias.name == "annotations" for alias in node.names)
            for node in tree.body
        )
        flags = __future__.annotations.compiler_flag if later else 0
        called_by_name = any(word in self.source for word in _BY_NAME)
        for node in _top(tree.body):
            if isinstance(node, FUNCTIONS) or (isinstance(node, _SIMPLE) and not called_by_name):
                nodes: Iterable[ast.AST] = ()
            else:
                nodes = executed(node)
            for inner in nodes:
                if isinstance(inner, ast.Import | ast.ImportFrom):
                    for alias in inner.names:
                        local, target, found = imported(inner, alias, self.package)
                        self.imports.setdefault(local, set()).add(target)
                        self.references |= found
                elif isinstance(inner, ast.Call):
                    self.references |= called(inner, self.package)
            if isinstance(node, ast.Import | ast.ImportFrom | ast.Pass) or _is_text(node):
                continue
            statement = Statement(node, self.package, flags)
            for name in statement.names:
                self.bound.setdefault(name, []).append(len(self.statements))
            self.statements.append(statement)


def _targets(node: ast.Assign | ast.AnnAssign) -> list[ast.expr]:
    return node.targets if isinstance(node, ast.Assign) else [node.target]


def _top(body: Iterable[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield statements at the top of a module except those under `TYPE_CHECKING`."""
    for node in body:
        if isinstance(node, ast.If) and _is_for_types(node):
            yield from _top(node.orelse)
        else:
            yield node


def executed(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield nodes that an import of the module runs: not those inside functions."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            waiting.extend(ast.iter_child_nodes(node))


def _is_main(node: ast.If) -> bool:
    """Return whether a statement is `if __name__ == "__main__":` alone."""
    test = node.test
    return (
        isinstance(test, ast.Compare)
        and chain(test.left) == ("__name__",)
        and isinstance(test.ops[0], ast.Eq)
        and not node.orelse
    )


def _is_for_types(node: ast.If) -> bool:
    return chain(node.test)[-1] == "TYPE_CHECKING"


def _is_text(node: ast.stmt) -> bool:
    value = node.value if isinstance(node, ast.Expr) else None
    return isinstance(value, ast.Constant) and isinstance(value.value, str)


def _text(value: object) -> str:
    """Return a text of compiled code, or of a constant in it; equal for equal ones only."""
    if isinstance(value, CodeType):
        numbers = (value.co_argcount, value.co_posonlyargcount, value.co_kwonlyargcount)
        names = (value.co_name, value.co_names, value.co_varnames, value.co_freevars)
        rest = (value.co_cellvars, value.co_flags, value.co_code, value.co_exceptiontable)
        return repr((numbers, names, rest, [_text(one) for one in value.co_consts]))
    if isinstance(value, frozenset):
        return f"frozenset({sorted(map(_text, value))})"
    if isinstance(value, tuple):
        return f"({','.join(map(_text, value))})"
    return repr(value)


def open_module(name: str, file: Path) -> Module:
    """Return a module; its file is read again after a change."""
    status = file.stat()
    return _read(name, file, status.st_mtime_ns, status.st_size)


@cache
def _read(name: str, file: Path, modified: int, size: int) -> Module:
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    return Module(name, file, package, file.read_bytes())


def module(name: str) -> Module | None:
    """Return a module read from its file; None if it is missing or a namespace package."""
    found = place(name)
    return open_module(name, found[0]) if found and found[0] else None


def place(name: str) -> Place | None:
    """Return the location of a module, found without importing anything."""
    top, *parts = name.split(".")
    try:
        spec = find_spec(top)  # a top-level name: nothing is imported to find it
    except ValueError:  # __main__, or a module created at run time
        return None
    if spec is None:
        return None
    file = Path(spec.origin) if spec.has_location and spec.origin else None
    found: Place | None = (file, tuple(spec.submodule_search_locations or ()))
    for part in parts:
        found = found and place_in([os.path.join(folder, part) for folder in found[1]])
    return found


def place_in(paths: list[str]) -> Place | None:
    """Return the location of a module among some paths, in the order of Python's import."""
    for path in paths:
        if os.path.isfile(file := os.path.join(path, "__init__.py")):
            return Path(file), (path,)
        for suffix in (*EXTENSION_SUFFIXES, ".py"):
            if os.path.isfile(path + suffix):
                return Path(path + suffix), ()
    spaces = tuple(filter(os.path.isdir, paths))
    return (None, spaces) if spaces else None


def imported(
    node: ast.Import | ast.ImportFrom, alias: ast.alias, package: str
) -> tuple[str, Reference, set[Reference]]:
    """Yield the local name that an import binds, its target, and the references looked up."""
    if isinstance(node, ast.ImportFrom):
        owner = _absolute("." * node.level + (node.module or ""), package)
        return alias.asname or alias.name, (owner, alias.name), {(owner, alias.name)}
    if alias.asname:
        return alias.asname, (alias.name, ""), {(alias.name, "")}
    parts = alias.name.split(".")
    return parts[0], (parts[0], ""), {(".".join(parts[:i]), "") for i in range(1, len(parts) + 1)}


def called(node: ast.Call, package: str) -> set[Reference]:
    """Return references of `import_module("a.b")`; a name computed at run time is unknown."""
    if node.args and chain(node.func)[-1] in {"import_module", "__import__"}:
        name = getattr(node.args[0], "value", None)
        return {(_absolute(name, package), "")} if isinstance(name, str) else set()
    return set()


def _absolute(name: str, package: str) -> str:
    """Return the absolute name of a module; unchanged if Python would refuse it."""
    try:
        return resolve_name(name, package)
    except ImportError:
        return name


def chain(node: ast.expr) -> tuple[str, ...]:
    """Return the names of `a.b.c`; the first is empty unless the expression begins with a name."""
    if isinstance(node, ast.Attribute):
        return (*chain(node.value), node.attr)
    return (node.id,) if isinstance(node, ast.Name) else ("",)


def names_in(node: ast.AST) -> set[Chain]:
    """Return the names that an expression uses."""
    names = (chain(one) for one in ast.walk(node) if isinstance(one, ast.Attribute | ast.Name))
    return {one for one in names if one[0]}
