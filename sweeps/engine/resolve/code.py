"""Digest of a function: hashes, by name, of its code and of the values that it holds.

1. A given `version` replaces everything else.
2. A function from a stage's file, a script or a notebook, or made at run time, counts by its
   instructions, defaults and closure, and by each global that it names, as they are when the sweep
   begins. Functions and classes of such files count by this rule, names from other modules or
   imported inside by rule 3, and any other value by its content.
3. A module of the packages in `Experiment.code`, or of no distribution, counts by its syntax tree
   without docstrings, comments and code for type checkers, as do all modules that it imports. Any
   other module counts by its distribution's version. The standard library and the engine do not
   count.
4. A value whose content cannot be compared, such as an open file or a lock, is refused.
"""

from __future__ import annotations

import copyreg
import dis
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from types import CodeType, FunctionType, MappingProxyType, MethodType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.resolve.keys import digest
from sweeps.engine.resolve.modules import (
    ENGINE,
    SHADERS,
    Modules,
    Reference,
    absolute_name,
    dist_versions,
    is_within,
    package_files,
    read_module,
)

MAIN = "__main__"
DISPLAY_FIELDS = {"help", "label"}  # of settings: they are only shown
# A function that names one of these may use any global of its file.
DYNAMIC_NAMES = {"eval", "exec", "globals", "modules", "__globals__", "__subclasses__"}
REMEDY = "or give version='1', which replaces the code in keys, and change it with the function"


class CodeDigest(NamedTuple):
    """Digest of a function, with its parts and its libraries by name."""

    digest: str  # depends on no absolute path and no order of discovery
    parts: Mapping[str, str]
    libraries: Mapping[str, str]  # versions of distributions


class Code:
    """Digests of functions.

    Parameters
    ----------
    roots : frozenset of str
        Packages and modules, by dotted names, whose sources (and shaders) count, with all below
        them but the engine.
    homes : frozenset of str
        Modules of stages, whose functions, classes and values count one by one.
    """

    def __init__(self, roots: frozenset[str], homes: frozenset[str] = frozenset()) -> None:
        self.modules, self.homes = Modules(roots), homes | {MAIN}

    def digest(self, function: Callable[..., Any], version: str = "") -> CodeDigest:
        """Return the digest of a function, or of a version instead of its code.

        Raises ConfigurationError if it holds a value without content to compare.
        """
        if version:
            content = repr((module_and_name(function), version))
            return CodeDigest(digest(content), {"version": version}, {})
        walk = _Walk(self, function)
        content = json.dumps([walk.root, walk.parts, walk.libraries], sort_keys=True)
        return CodeDigest(digest(content), walk.parts, walk.libraries)


class _Scan(NamedTuple):
    """Instructions of code as text, the globals that it names with attributes, and imports."""

    text: str
    chains: list[tuple[str, ...]]
    imports: list[Reference]
    names: set[str]


_GLOBALS = {"LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS"}
_ATTRIBUTES = {"LOAD_ATTR", "LOAD_METHOD"}
_NAME_OPCODES = {*dis.hasname, *dis.haslocal, *dis.hasfree, *dis.hasjrel, *dis.hasjabs}
# Attributes of a class body that hold its docstring and line numbers; each takes two instructions.
_CLASS_METADATA = {"__doc__", "__firstlineno__", "__static_attributes__"}
_FLAGS = 0x3FF  # flags of code: kinds of arguments and of functions


@cache
def _scan(code: CodeType) -> _Scan:
    """Return the instructions of code, without docstrings and line numbers."""
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount)
    names = (code.co_varnames, code.co_cellvars, code.co_freevars)
    lines = [repr((counts, names, code.co_flags & _FLAGS, code.co_exceptiontable))]
    inner = [_scan(constant) for constant in code.co_consts if isinstance(constant, CodeType)]
    chains = [chain for scan in inner for chain in scan.chains]
    imports = [reference for scan in inner for reference in scan.imports]
    steps = [step for step in dis.get_instructions(code) if step.opname != "EXTENDED_ARG"]
    in_chain = False
    for number, step in enumerate(steps):
        argument = step.argval if step.opcode in _NAME_OPCODES else step.arg
        constant = step.opcode in dis.hasconst
        lines.append(f"{step.opname} {_constant(step.argval) if constant else argument}")
        in_chain &= step.opname in _ATTRIBUTES
        if in_chain:
            chains[-1] += (step.argval,)
        elif step.opname in _GLOBALS:
            chains.append((step.argval,))
            in_chain = True
        elif step.opname == "IMPORT_NAME":
            imports.append(("." * steps[number - 2].argval + step.argval, ""))
        elif step.opname == "IMPORT_FROM":
            imports.append((imports[-1][0], step.argval))
        elif step.opname == "STORE_NAME" and step.argval in _CLASS_METADATA:
            del lines[-2:]
    all_names = {*code.co_names}.union(*(scan.names for scan in inner))
    return _Scan("\n".join(lines), chains, imports, all_names)


def _constant(value: Any) -> str:
    """Return the text of a constant in code."""
    if isinstance(value, CodeType):
        return _scan(value).text
    if isinstance(value, tuple | frozenset):
        parts = [*map(_constant, value)]
        return repr(parts if isinstance(value, tuple) else {"set": sorted(parts)})
    return f"{type(value).__name__} {value!r}"


_ATOMS = {type(None), bool, int, float, complex, str, bytes, type(...), type(NotImplemented)}
_DEFINITIONS = FunctionType | type | ModuleType  # parts of their own
_DESCRIPTOR_PARTS = ("fget", "fset", "fdel", "__func__", "func")


class _Walk:
    """Traversal of everything that a function depends on: hashes by name, and libraries."""

    def __init__(self, code: Code, root: Callable[..., Any]) -> None:
        module, name = module_and_name(root)
        self._modules, self._homes = code.modules, code.homes | {module}
        self.parts: dict[str, str] = {}
        self.libraries: dict[str, str] = {}
        self._added_modules: set[str] = set()
        self._labels: dict[int, str] = {}
        self._waiting: list[tuple[str, Any]] = []  # functions and classes
        self._tokens: dict[int, str] = {}
        self._active_ids: list[int] = []
        self._kept_alive: list[Any] = []  # objects whose ids are known
        self.root = self._variable_token(name, root)
        for label, target in self._waiting:  # which grows
            content = self._class_content if isinstance(target, type) else self._function_content
            part = content(label, target)
            self.parts[f"code of {label}"] = digest(repr(part))

    def _label(self, target: Any, name: str) -> str:
        """Return a unique name of a function, class or file; number repeated names."""
        if id(target) not in self._labels:
            self._kept_alive.append(target)
            same = sum(label.partition(" ")[0] == name for label in self._labels.values())
            self._labels[id(target)] = f"{name} {same + 1}" if same else name
            if isinstance(target, _DEFINITIONS):
                self._waiting.append((self._labels[id(target)], target))
        return self._labels[id(target)]

    def _variable_token(self, name: str, value: Any) -> str:
        """Return the token of a variable; store a plain value as a part, and return its name."""
        self._name, self._value = name, value
        token = self.token(value)
        if not isinstance(value, _DEFINITIONS):
            self.parts[name], token = digest(token), name
        return token

    def _function_content(self, label: str, function: FunctionType) -> Any:
        """Return the code of a function, and the tokens of its variables."""
        code, namespace = function.__code__, function.__globals__
        module = _module_of(function)
        if module == "functools" and hasattr(function, "registry"):  # one for each type
            return self._variable_token(f"registry of {label}", function.registry)
        defaults = function.__defaults__ or ()
        values = dict(zip(code.co_varnames[: code.co_argcount][::-1], defaults[::-1], strict=False))
        values |= {**(function.__kwdefaults__ or {}), **vars(function)}
        for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            with suppress(ValueError):  # an empty cell
                values[name] = cell.cell_contents
        variables = [
            (key, self._variable_token(f"{key} of {label}", values[key])) for key in sorted(values)
        ]
        if self._counts_with_module(function, module):
            return variables
        scan, file_label = _scan(code), self._label(namespace, module)
        for owner, name in scan.imports:
            self._add_module(absolute_name(owner, namespace.get("__package__") or module), name)
        if DYNAMIC_NAMES & scan.names:
            self._add_file(label, namespace)
        variables += [
            self._global_content(file_label, chain, namespace[chain[0]])
            for chain in sorted({*scan.chains})
            if chain[0] in namespace
        ]
        return scan.text, variables

    def _global_content(self, file_label: str, chain: Sequence[str], value: Any) -> tuple[str, str]:
        """Return the path and token of a global, named with a chain of attributes."""
        path, *attributes = chain
        while attributes and isinstance(value, ModuleType) and value.__name__ in self._homes:
            path, value = f"{path}.{attributes[0]}", getattr(value, attributes.pop(0), None)
        if not isinstance(value, ModuleType):
            return path, self._variable_token(f"{file_label}.{path}", value)
        for number, name in enumerate(attributes or [""]):
            self._add_module(".".join((value.__name__, *attributes[:number])), name)
        return path, f"module {value.__name__}"

    def _class_content(self, label: str, cls: type) -> Any:
        """Return bases, methods and values of a class."""
        self._name, self._value = label, cls
        functions = FunctionType | property | staticmethod | classmethod
        members = {
            name: value
            for name, value in vars(cls).items()
            if isinstance(value, functions) or not (name.startswith("__") or name == "_abc_impl")
        }
        return self.token((type(cls), *cls.__bases__)), self.token(members)

    def _add_file(self, label: str, namespace: Mapping[str, Any]) -> None:
        """Add the whole file of a function that may use any of its globals."""
        name, file = namespace.get("__name__", MAIN), Path(namespace.get("__file__") or "")
        if file.suffix != ".py" or not file.is_file():
            problem = f"{label} uses eval or similar, and is in no file"
            raise ConfigurationError(f"{problem}: name the values that it takes, {REMEDY}")
        module = read_module(name, file, file.stat().st_mtime_ns)
        self.parts[f"code of {name}"] = module.digest
        for target in module.imports:
            self._add_module(*target)

    def _add_module(self, owner: str, name: str = "") -> None:
        """Add a module, or the name imported from it, and its imports, to the parts."""
        waiting = [*self._modules.loaded_with(owner, name)]
        for module_name in waiting:  # which grows
            if module_name in self._added_modules:
                continue
            self._added_modules.add(module_name)
            if not self._modules.is_source(module_name):
                if module_name not in sys.stdlib_module_names:
                    self.libraries |= dist_versions(module_name)
                continue
            if module := self._modules.module(module_name):
                self.parts[f"code of {module_name}"] = module.digest
            if "." not in module_name and (shaders := package_files(module_name, SHADERS)):
                self.parts[f"shaders of {module_name}"] = digest(repr(shaders))
            waiting += self._modules.imports(module_name)

    def _counts_with_module(self, definition: FunctionType | type, module: str) -> bool:
        """Return whether a function or class counts as part of its module."""
        if module in self._homes or module not in sys.modules:
            return False
        if isinstance(definition, FunctionType):
            return vars(sys.modules[module]) is definition.__globals__
        is_source = self._modules.is_source(module)
        return not is_source or find_attribute(module, definition.__qualname__) is definition

    def _reference(self, target: Any) -> str:
        """Return the name of a function, class or module, and add it to the parts."""
        if isinstance(target, ModuleType):
            self._add_module(target.__name__)
            return f"module {target.__name__}"
        module = _module_of(target)
        if self._counts_with_module(target, module):
            self._add_module(module)
            if isinstance(target, type) or find_attribute(module, target.__qualname__) is target:
                return f"{module}.{target.__qualname__}"
        return self._label(target, f"{module}.{target.__qualname__}")

    def token(self, value: Any) -> str:
        """Return a text that is equal for values of equal type and content."""
        if type(value) in _ATOMS:
            return f"{type(value).__name__} {value!r}"
        if isinstance(value, _DEFINITIONS):
            return self._reference(value)
        if id(value) in self._active_ids:
            return f"circle {len(self._active_ids) - self._active_ids.index(id(value))}"
        if id(value) not in self._tokens:
            self._kept_alive.append(value)
            self._active_ids.append(id(value))
            try:
                content = self._content(value)
            except ConfigurationError:
                raise
            except Exception as error:
                verb = "is" if value is self._value else "holds"
                problem = f"{self._name} {verb} {type(value).__name__!r}, which has no content to"
                remedy = f"compare: pass only the data that the function needs, {REMEDY}"
                raise ConfigurationError(f"{problem} {remedy}") from error
            self._active_ids.pop()
            self._tokens[id(value)] = f"{type(value).__name__} {digest(repr(content))}"
        return self._tokens[id(value)]

    def _content(self, value: Any) -> Any:
        """Return the tokens of a value's parts; raise any error if it has none."""
        kind = type(value)
        if kind in (list, tuple):
            return [*map(self.token, value)]
        if kind in (set, frozenset):
            return sorted(map(self.token, value))
        if kind in (dict, MappingProxyType):
            keys = sorted(value, key=self.token)  # the order of a mapping does not count
            return [(self.token(key), self.token(value[key])) for key in keys]
        if kind in (property, staticmethod, classmethod, cached_property):
            return [self.token(getattr(value, name, None)) for name in _DESCRIPTOR_PARTS]
        if kind is np.ndarray:
            objects = value.dtype.hasobject
            content = self.token(value.tolist()) if objects else digest(value.tobytes())
            return repr(value.dtype), value.shape, content
        if is_within(kind.__module__, ENGINE) and is_dataclass(value):
            names = {field.name for field in fields(value)} - DISPLAY_FIELDS
            return self.token(kind), self.token({name: getattr(value, name) for name in names})
        if hasattr(kind, "__dask_tokenize__"):
            from dask.base import tokenize

            return tokenize(value, ensure_deterministic=True)
        if hasattr(value, "__wrapped__") and hasattr(value, "targetoptions"):  # numba's
            return self.token(value.__wrapped__), self.token(value.targetoptions)
        reduce = copyreg.dispatch_table.get(kind)
        reduced = value.__reduce_ex__(4) if reduce is None else reduce(value)
        if isinstance(reduced, str):  # a name of a module, or a cached function
            inner = getattr(value, "__wrapped__", None)
            if inner is None:
                self._add_module(getattr(value, "__module__", None) or kind.__module__)
            return reduced, self.token(inner)
        make, arguments, *extras = reduced
        state, items, pairs = (*extras, None, None, None)[:3]
        if isinstance(state, dict):  # without cached properties, which derive from the rest
            kinds = {name: type(getattr(kind, str(name), None)) for name in state}
            state = {name: state[name] for name in state if kinds[name] is not cached_property}
            state = state or None
        parts = (make, arguments, state, [*(items or ())], dict(pairs or ()))
        return [*map(self.token, parts)]


def find_attribute(module: str, name: str) -> Any:
    """Return an attribute of an imported module by its dotted name; None if it is absent."""
    attribute: Any = sys.modules.get(module)
    for part in name.split("."):
        attribute = getattr(attribute, part, None)
    return attribute


def module_and_name(function: Callable[..., Any]) -> tuple[str, str]:
    """Return module and qualified name of the innermost wrapped function."""
    innermost: Any = None
    inner: Any = function
    while inner is not None:
        innermost, is_partial = inner, isinstance(inner, partial)
        inner = getattr(innermost, "func" if is_partial else "__wrapped__", None)
        inner = innermost.__func__ if isinstance(innermost, MethodType) else inner
    innermost = innermost if hasattr(innermost, "__qualname__") else type(innermost)
    return _module_of(innermost), innermost.__qualname__


def _module_of(definition: Any) -> str:
    """Return the name of the module in which a function or class was made."""
    return getattr(definition, "__globals__", {}).get("__name__") or definition.__module__ or MAIN
