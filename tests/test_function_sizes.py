"""Functions have at most 8 parameters and 60 lines of code without docstrings."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("benchmarks", "docs", "ncti", "studies", "sweeps")
MAX_PARAMETERS, MAX_LINES = 8, 60
KEYWORDS = {  # of functions that users call, and of a scikit-learn estimator
    "ncti/classify/gain_annealed.py:GainAnnealedNetwork.__init__",
    "ncti/data/rows.py:dataset",
    "ncti/simulate/images.py:infrared_image",
    "ncti/simulate/profiles.py:range_profile",
    "studies/operate/identify.py:identify",
    "sweeps/engine/function/sweep.py:sweep",
}
STAGES = {"answers", "derived", "in_memory", "stage"}  # decorators: parameters are inputs by name


def functions(tree: ast.AST, of: str = "") -> Iterator[tuple[str, ast.FunctionDef]]:
    """Yield functions of a module with their names, including those in classes and functions."""
    for node in ast.iter_child_nodes(tree):
        name = f"{of}{getattr(node, 'name', '')}"
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield name, node
        inner = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        yield from functions(node, f"{name}." if inner else of)


def parameters(node: ast.FunctionDef) -> int:
    """Return the number of parameters, without `self`, `cls`, `*args` and `**kwargs`."""
    given = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
    return len(given) - (bool(given) and given[0].arg in ("self", "cls"))


def lines(node: ast.FunctionDef) -> int:
    """Return the number of lines of a function without its decorators and docstring."""
    total = node.end_lineno - node.lineno + 1
    if ast.get_docstring(node) is None:
        return total
    return total - (node.body[0].end_lineno - node.body[0].lineno + 1)


def is_stage(node: ast.FunctionDef) -> bool:
    called = (one.func if isinstance(one, ast.Call) else one for one in node.decorator_list)
    return any(getattr(one, "attr", getattr(one, "id", "")) in STAGES for one in called)


def test_functions_are_short_and_have_few_parameters():
    found = {
        f"{path.relative_to(ROOT).as_posix()}:{name}": node
        for folder in FOLDERS
        for path in (ROOT / folder).rglob("*.py")
        for name, node in functions(ast.parse(path.read_text(encoding="utf-8")))
    }
    many = {name for name, node in found.items() if parameters(node) > MAX_PARAMETERS}
    assert {name for name in many if not is_stage(found[name])} == KEYWORDS
    assert not [name for name, node in found.items() if lines(node) > MAX_LINES]
