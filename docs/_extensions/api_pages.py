"""Reference pages of the packages of `ncti`, one per package, listing its `__all__`."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

FOLDER = "api"
MARKUP = (":", ".. ", "- ", "* ", ">>>", "|", "+", "=")  # begin lines that are no prose
CODE = re.compile(r"(``.*?``|`.*?`)")  # nothing in it is escaped


def origins(package: ModuleType) -> dict[str, str]:
    """Return where each name of a package is imported from, such as `ncti.ladar.pulse.kernel`."""
    return {
        alias.asname or alias.name: f"{node.module}.{alias.name}"
        for node in ast.walk(ast.parse(inspect.getsource(package)))
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }


def page_of(name: str) -> str:
    """Return the page of a package as reStructuredText: summaries, then every member."""
    package = import_module(name)
    members = {
        member: getattr(package, member) for member in sorted(package.__all__, key=str.lower)
    }
    functions = [name for name, member in members.items() if inspect.isroutine(member)]
    classes = [name for name, member in members.items() if inspect.isclass(member)]
    constants = [name for name in members if name not in {*functions, *classes}]
    parts = [name, "=" * len(name), "", f".. automodule:: {name}", "", f".. currentmodule:: {name}"]
    listed = "".join(f"   {name}\n" for name in functions + classes)
    if listed:
        parts += ["", ".. autosummary::", "   :nosignatures:", "", listed]
    for title, names, directive in (
        ("Functions", functions, "autofunction"),
        ("Classes", classes, "autoclass"),
    ):
        parts += ["", title, "-" * len(title), ""] if names else []
        for member in names:
            parts += [f".. {directive}:: {member}"]
            parts += ["   :members:", ""] if directive == "autoclass" else [""]
    if constants:
        parts += ["", "Constants", "---------", ""]
        # A constant has its docstring where it is assigned.
        origin = origins(package)
        parts += [
            f".. autodata:: {origin.get(constant, f'{name}.{constant}')}" for constant in constants
        ]
    return "\n".join(parts) + "\n"


def write_pages(app: Any) -> None:
    """Write the pages that have changed."""
    folder = Path(app.srcdir) / FOLDER
    folder.mkdir(exist_ok=True)
    pages = {
        folder / f"ncti.{package}.rst": f"ncti.{package}"
        for package in import_module("ncti").__all__
    }
    for path in {*folder.glob("*.rst")} - {*pages}:
        path.unlink()
    for path, name in pages.items():
        text = page_of(name)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def plain_equations(lines: list[str]) -> Iterator[str]:
    """Yield the lines of a docstring with its equations as they were typed.

    Turn an indented block after a paragraph into a literal block, and escape bars, as in |x|.
    """
    above: int | None = None  # indentation of the line above the block that we are in
    for number, line in enumerate(lines):
        if above is not None and line.strip() and indent(line) <= above:
            above = None
        if above is not None:
            yield line
        elif introduces_block(lines, number):
            above = indent(line)
            yield escape_bars(line)
            if not line.endswith("::"):
                yield from ("", f"{' ' * indent(line)}::")
        else:
            yield escape_bars(line)


def indent(line: str) -> int:
    """Return the number of spaces that a line begins with."""
    return len(line) - len(line.lstrip())


def introduces_block(lines: list[str], number: int) -> bool:
    """Return whether a line ends a paragraph behind which an indented block follows."""
    line, after = lines[number], lines[number + 1 :]
    if not line.strip() or line.lstrip().startswith(MARKUP):
        return False
    following = next((following_line for following_line in after if following_line.strip()), "")
    return bool(after) and not after[0].strip() and indent(following) > indent(line)


def escape_bars(line: str) -> str:
    """Return a line of prose in which a bar starts no substitution."""
    if line.lstrip().startswith((">>>", "| ", ".. ")):
        return line
    pieces = CODE.split(line)
    return "".join(
        piece if CODE.fullmatch(piece) else re.sub(r"(?<!\\)\|", r"\\|", piece) for piece in pieces
    )


def mend_docstring(
    app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Repair the equations of a docstring after numpydoc."""
    lines[:] = plain_equations(lines)


def skip(app: Any, what: str, name: str, obj: Any, skipped: bool, options: Any) -> bool | None:
    """Leave out the methods that scikit-learn adds to every estimator."""
    return True if re.fullmatch(r"set_\w+_request", name) else None


def setup(app: Any) -> dict[str, Any]:
    """Write the pages before Sphinx looks for pages."""
    app.setup_extension("sphinx.ext.autodoc")
    connect: Callable[..., Any] = app.connect
    connect("builder-inited", write_pages, priority=100)
    connect("autodoc-process-docstring", mend_docstring, priority=900)  # behind numpydoc
    connect("autodoc-skip-member", skip)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
