"""Statements that a function reaches, in its module and in those that it imports.

A statement reaches those that bind the names it uses, and what these use in turn. Statements that
may do more than bind names, such as `register(f)` at the top of a module, are reached wherever the
module is imported; where names cannot be followed (`globals()`, `from a import *`, a module as a
value), all of a module is.
"""

from __future__ import annotations

import ast
import builtins
import hashlib
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, partial

from sweeps.engine.libraries import versions
from sweeps.engine.sources import (
    ANY_NAME,
    FUNCTIONS,
    MAKING,
    Chain,
    Module,
    Reference,
    Statement,
    chain,
    module,
    names_in,
    place,
)

LABELS = frozenset({"help", "label"})  # arguments of declarations that are only shown
LABEL_PLACE = {"Output": 3}  # of those without a name
REGISTERING = re.compile("register|overload")  # in the name of a library's decorator

_CHANGING = frozenset({"append", "extend", "insert", "add", "pop", "setdefault", "update"})

Node = tuple[str, int]  # a module, and one of its statements, or
LOADED, WHOLE = -1, -2  # that it is imported, or all of it


@dataclass
class _Reached:
    """What a node leads to: other nodes, libraries, and texts of the names that led there."""

    nodes: set[Node] = field(default_factory=set)
    libraries: set[str] = field(default_factory=set)
    links: set[str] = field(default_factory=set)


class Graph:
    """What statements reach; the sources of some packages count, and those of others do not."""

    def __init__(self, roots: frozenset[str], without: frozenset[str]) -> None:
        self._roots, self._without = roots, without
        self._started: dict[str, Module] = {}
        self._edges = cache(self._reach)
        self._digest = cache(self._digest_of)
        self._kind = cache(self._kind_of)
        self._place = cache(place)
        self._module = cache(module)

    def module(self, name: str) -> Module | None:
        """Return a module by its name."""
        return self._started.get(name) or self._module(name)

    def closure(
        self, start: Module, places: Sequence[int]
    ) -> tuple[dict[str, list[str]], set[str]]:
        """Return hashes of the statements reached, by module imported, and the libraries."""
        if self._started.setdefault(start.name, start) is not start:  # changed since
            self.__init__(self._roots, self._without)  # type: ignore[misc]
            self._started[start.name] = start
        found = {(start.name, LOADED), *((start.name, at) for at in places)}
        waiting, libraries = list(found), set[str]()
        while waiting:
            edges = self._edges(*waiting.pop())
            libraries |= edges.libraries
            waiting += edges.nodes - found
            found |= edges.nodes
        code: dict[str, list[str]] = {}
        for name, at in sorted(found):
            code.setdefault(name, [])
            if at >= 0:
                code[name].append(self._digest(name, at))
            elif at == LOADED and (compiled := self.module(name)) and not compiled.is_python:
                code[name].append(hashlib.sha256(compiled.source).hexdigest())
        return code, libraries

    def _digest_of(self, name: str, at: int) -> str:
        """Return the hash of a statement, and of the names by which it reaches others."""
        of = self.module(name)
        assert of is not None
        text = of.statements[at].compiled(
            partial(self._declares, of), partial(self._unlabelled, of)
        )
        parts = repr((text, sorted(self._edges(name, at).links)))
        return hashlib.blake2b(parts.encode(), digest_size=16).hexdigest()

    def _reach(self, name: str, at: int) -> _Reached:
        """Return what a statement leads to, or a module that is imported, or all of one."""
        found, of = _Reached({(name, LOADED)}), self.module(name)
        if of is None:
            return found
        if at == LOADED:
            self._import(of, found)
        elif at == WHOLE:
            found.nodes |= {(name, place) for place in range(len(of.statements))}
            for targets in of.imports.values():
                for target in targets:
                    self._refer(target, (), found, set())
        else:
            self._use(of, of.statements[at], found)
        return found

    def _import(self, of: Module, found: _Reached) -> None:
        """Add what an import of a module runs."""
        for reference in of.references:
            self._load(reference, found)
        acting = (at for at, one in enumerate(of.statements) if self._acts(of, one))
        found.nodes |= {(of.name, at) for at in acting}
        # parent packages whose import has side effects, such as setting a variable
        parts = of.name.split(".")
        for parent in (".".join(parts[:i]) for i in range(1, len(parts))):
            above = self.module(parent) if _within(parent, self._roots) else None
            if above is not None and any(self._acts(above, one) for one in above.statements):
                found.nodes.add((parent, LOADED))

    def _load(self, reference: Reference, found: _Reached) -> None:
        """Add the modules, or the library, that an import statement loads."""
        owner, name = reference
        kind = self._kind(f"{owner}.{name}" if name else owner)
        if kind == "source":
            loaded = (one for one in self._targets(owner, name) if self._kind(one) == "source")
            found.nodes |= {(one, LOADED) for one in loaded if self.module(one)}
        elif kind == "library":
            found.libraries.add(owner.partition(".")[0])

    def _use(self, of: Module, statement: Statement, found: _Reached) -> None:
        """Add what the names in a statement refer to."""
        uses = statement.uses
        for reference in uses.references:
            self._load(reference, found)
        for reference in uses.modules:
            self._refer(reference, (), found, set())
        declaring = {
            names
            for one in statement.decorators
            if self._declares(of, one)
            for names in names_in(one)
        }
        for names in uses.chains - (declaring - _names_of(statement, declaring)):
            root, *rest = names
            for target in uses.imports.get(root, ()):
                self._refer(target, rest, found, set())
            self._look_up(of, names, found, set())
            hidden = root in ANY_NAME and root not in of.names and hasattr(builtins, root)
            if hidden or "__globals__" in rest or tuple(names[:2]) == ("sys", "modules"):
                found.nodes.add((of.name, WHOLE))
        if any(name == "*" for targets in of.imports.values() for _, name in targets):
            found.nodes.add((of.name, WHOLE))

    def _look_up(
        self, of: Module, names: Sequence[str], found: _Reached, seen: set[tuple[str, str]]
    ) -> bool:
        """Add what binds a name at the top of a module; return whether anything does."""
        root, *rest = names
        found.nodes |= {(of.name, at) for at in of.bound.get(root, ())}
        targets = of.imports.get(root, set())
        if targets:
            found.links.add(f"{of.name}.{root}: {sorted(targets)}")
        if (of.name, root) not in seen:
            seen.add((of.name, root))
            for target in targets:
                self._refer(target, rest, found, seen)
        return bool(targets) or root in of.bound

    def _refer(
        self,
        target: Reference,
        rest: Sequence[str],
        found: _Reached,
        seen: set[tuple[str, str]],
    ) -> None:
        """Add what an imported name refers to, and then `rest` behind it."""
        owner, name = target
        kind = self._kind(f"{owner}.{name}" if name else owner)
        if kind == "library":
            found.libraries.add(owner.partition(".")[0])
        if kind != "source":
            return
        if name == "*":
            below = (one for one in self._targets(owner, name) if self._kind(one) == "source")
            found.nodes |= {(one, WHOLE) for one in below if self.module(one)}
        elif not name:
            self._descend(owner, rest, found, seen)
        elif self._place(f"{owner}.{name}") is None:
            self._attribute(owner, (name, *rest), found, seen)
        else:
            self._descend(f"{owner}.{name}", rest, found, seen)
            if (package := self.module(owner)) and name in package.names:
                self._look_up(package, (name, *rest), found, seen)

    def _descend(
        self, name: str, rest: Sequence[str], found: _Reached, seen: set[tuple[str, str]]
    ) -> None:
        """Add what `rest` is of a module; all of it if there is none."""
        if self.module(name) is not None:
            found.nodes.add((name, LOADED))
        if rest:
            self._attribute(name, rest, found, seen)
        elif self.module(name) is not None:
            found.nodes.add((name, WHOLE))

    def _attribute(
        self, name: str, names: Sequence[str], found: _Reached, seen: set[tuple[str, str]]
    ) -> None:
        """Add what an attribute of a module is: bound there, a module below it, or unknown."""
        if self._kind(name) != "source":
            return
        of, (first, *rest) = self.module(name), names
        if of is not None:
            found.nodes.add((name, LOADED))
            if self._look_up(of, names, found, seen):
                return
        if self._place(f"{name}.{first}") is not None:
            if self._kind(f"{name}.{first}") == "source":
                self._descend(f"{name}.{first}", rest, found, seen)
        elif of is not None and not first.startswith("__"):
            loaded = self._targets(name, first) if "__getattr__" in of.names else {name}
            known = (one for one in loaded if self._kind(one) == "source" and self.module(one))
            found.nodes |= {(one, WHOLE) for one in (*known, name)}

    def _kind_of(self, name: str) -> str:
        """Return whether a module counts by its source, as a library, or not at all."""
        if _within(name, self._without):
            return ""
        top = name.partition(".")[0]
        standard = top in sys.stdlib_module_names
        if _within(name, self._roots) or not (standard or versions(top)):
            return "source"
        return "" if standard else "library"

    def _acts(self, of: Module, statement: Statement) -> bool:
        """Return whether a statement at the top of a module may do more than bind names."""
        node = statement.node
        if statement.is_script:
            return statement.assigns_inside
        if not (statement.assigns or statement.defines):
            return True
        given = [*statement.decorators, *getattr(node, "bases", ())]
        keywords = [one.arg for one in getattr(node, "keywords", ())]
        changes = isinstance(node, ast.ClassDef) and statement.assigns_inside
        if changes or "metaclass" in keywords or any(self._is_own(of, one) for one in given):
            return True
        return any(self._registers(of, names, set()) for names in statement.used_by_calls)

    def _registers(self, of: Module, names: Chain, seen: set[tuple[str, Chain]]) -> bool:
        """Return whether a call of a name changes an object of a module, directly or further on."""
        root, *rest = names
        if not root or (of.name, names) in seen:
            return False
        seen.add((of.name, names))
        if _changes(of, names):
            return True
        for statement in (of.statements[at] for at in of.bound.get(root, ())):
            declares = any(self._declares(of, one) for one in statement.decorators)
            if not declares and any(self._registers(of, one, seen) for one in statement.calls):
                return True
        for owner, name in of.imports.get(root, set()):
            if self._kind(owner) != "source":
                continue
            inner = [*([name] if name else []), *rest]
            if name and self._place(f"{owner}.{name}") is not None:
                owner, inner = f"{owner}.{name}", rest
            while len(inner) > 1 and self._place(f"{owner}.{inner[0]}") is not None:
                owner, inner = f"{owner}.{inner[0]}", inner[1:]
            there = self.module(owner) if inner else None
            if there is not None and self._registers(there, tuple(inner), seen):
                return True
        return False

    def _is_own(self, of: Module, node: ast.expr) -> bool:
        """Return whether a decorator or a base is of a source that counts, or computed."""
        if self._declares(of, node):
            return False
        root, *rest = chain(node.func if isinstance(node, ast.Call) else node)
        targets = of.imports.get(root, set())
        known = bool(targets) or hasattr(builtins, root)
        if root in of.bound or not known or REGISTERING.search(".".join((root, *rest))):
            return True
        return any(self._kind(f"{owner}.{name}") == "source" for owner, name in targets)

    def _declares(self, of: Module, node: ast.expr) -> bool:
        """Return whether a decorator is of the engine, or a `partial` of one: it only declares.

        What it declares counts by its values, where they matter, in the keys of results.
        """
        root, *rest = chain(node.func if isinstance(node, ast.Call) else node)
        places = of.bound.get(root, ())
        if len(places) == 1 and not rest and root not in of.imports:
            value = getattr(of.statements[places[0]].node, "value", None)
            if isinstance(value, ast.Call) and chain(value.func)[-1] == "partial" and value.args:
                own = root in {one for one, *_ in names_in(value.args[0])}
                return not own and self._declares(of, value.args[0])
        return self._is_engine(of, root)

    def _is_engine(self, of: Module, root: str) -> bool:
        """Return whether a name is imported from where sources do not count."""
        targets = of.imports.get(root, set())
        return bool(targets) and all(
            _within(f"{owner}.{name}" if name else owner, self._without) for owner, name in targets
        )

    def _unlabelled(self, of: Module, call: ast.Call) -> ast.Call:
        """Return a call without labels and help, if it is one of the engine's declarations."""
        names = chain(call.func)
        if not self._is_engine(of, names[0]):
            return call
        keywords = [
            one
            for one in call.keywords
            if one.arg not in LABELS or not isinstance(one.value, ast.Constant)
        ]
        at = LABEL_PLACE.get(names[-1], len(call.args))
        args = [
            one for n, one in enumerate(call.args) if n != at or not isinstance(one, ast.Constant)
        ]
        return ast.Call(call.func, args, keywords)

    def _targets(self, owner: str, name: str) -> set[str]:
        """Return modules imported by `from owner import name`: of that name, or defining it."""
        package = self.module(owner)
        if name and name != "*" and self._place(f"{owner}.{name}") is not None:
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


graph_of = cache(Graph)


def _names_of(statement: Statement, among: set[Chain]) -> set[Chain]:
    """Return which of some names a definition uses outside its decorators."""
    outside = {inner for one in statement.decorators for inner in ast.walk(one)}
    rest = (one for one in ast.walk(statement.node) if one not in outside)
    return among & {chain(one) for one in rest if isinstance(one, ast.Attribute | ast.Name)}


def _within(name: str, packages: frozenset[str]) -> bool:
    """Return whether a module is in, or is itself, one of some packages."""
    return any(f"{name}.".startswith(f"{package}.") for package in packages)


def _changes(of: Module, names: Chain) -> bool:
    """Return whether what a name is, called, changes an object of the module or an argument."""
    statements = [of.statements[at] for at in of.bound.get(names[0], ())]
    if names[-1] in _CHANGING and any(one.assigns for one in statements):
        return True
    for statement in (one for one in statements if one.defines):
        known = of.names | statement.uses.imports.keys()
        if any(one[0] in known for one in _changed(statement.node)):
            return True
        inside = [one for one in ast.walk(statement.node) if isinstance(one, FUNCTIONS)]
        for function in (one for one in inside if one.name not in MAKING):
            given = {one.arg for one in function.args.args}
            if any(one[0] in given for one in _changed(function)):
                return True
    return False


def _changed(function: ast.AST) -> Iterator[Chain]:
    """Yield what a function assigns to, or calls a method of without using the result."""
    for node in ast.walk(function):
        if isinstance(node, ast.Global):
            yield from ((name,) for name in node.names)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            if chain(called := node.value.func) == ("setattr",) or isinstance(
                called, ast.Attribute
            ):
                yield chain(called if isinstance(called, ast.Attribute) else node.value.args[0])
        elif isinstance(node, ast.Attribute | ast.Subscript) and not isinstance(node.ctx, ast.Load):
            while isinstance(node, ast.Attribute | ast.Subscript):
                node = node.value
            yield chain(node)
