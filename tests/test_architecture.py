"""Imports follow `layers.yaml`."""

import ast
import re
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions
from itertools import chain
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent

ALLOWED_IMPORTS = yaml.safe_load(Path(__file__).with_name("layers.yaml").read_text())
OTHERS = ("ncti.*", "studies.*")  # packages that have no rule of their own
OURS = ("ncti", "studies", "sweeps")
PROJECT = {"ncti", "studies", "sweeps", "benchmarks", "docs"}
ONLY_THE_ENGINE = {"hydra", "omegaconf", "dask", "distributed", "zarr"}
ALLOWED_OTHERS = {("sweeps.report", "zarr")}  # it reads stores
OF_THE_EXPERIMENT = (
    r"(?i)(?<![a-z])(aspects?|pulse_?widths?|ladar|irar|infrared|ships?|silhouettes?|vigilances?|"
    r"frame_counts?|receivers?|classifiers?|ncti)(?![a-z])"
)


def package_of(module: str) -> str:
    return ".".join(module.split(".")[:2])


@cache
def imports(path: Path) -> set[str]:
    """Return absolute names of all modules that a file imports, wherever in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} has a relative import"
            assert node.module is not None
            # `from ncti import ladar` names a package in its alias
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@cache
def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def rule(own: str) -> list[str]:
    """Return the names that a package may import besides itself."""
    return ALLOWED_IMPORTS[own if own in ALLOWED_IMPORTS else f"{own.partition('.')[0]}.*"]


def violations(path: Path) -> list[str]:
    """Return imports of a module that its package may not have."""
    own = package_of(name_of(path))
    found = []
    for name in imports(path):
        top = name.split(".")[0]
        if top in PROJECT and name != own.split(".")[0]:
            if not {top, package_of(name)} & {own, *rule(own)}:
                found.append(f"{own} imports {name}")
        elif top in ONLY_THE_ENGINE and own != "sweeps.engine" and (own, top) not in ALLOWED_OTHERS:
            found.append(f"{own} imports {name}")
    return found


CODE = [path for package in OURS for path in modules(package) if "." in name_of(path)]


@pytest.mark.parametrize("path", CODE, ids=name_of)
def test_imports_go_one_way(path):
    assert violations(path) == []


@pytest.mark.parametrize("path", modules("benchmarks"), ids=name_of)
def test_benchmarks_never_import_docs(path):
    assert not {name for name in imports(path) if name.split(".")[0] == "docs"}


def test_every_import_rule_names_an_existing_layer():
    packages = {package_of(name_of(path)) for path in CODE}
    assert set(ALLOWED_IMPORTS) - {*OTHERS} <= packages
    assert all(
        name in ALLOWED_IMPORTS or f"{name.partition('.')[0]}.*" in OTHERS for name in packages
    )


# Layers of the engine, the lowest first; a package imports from lower layers and from itself.
ENGINE_LAYERS = (
    *(("declare",), ("objects", "resolve"), ("cache",), ("run",), ("store",), ("sweeping",)),
    ("command", "function"),
)
FRONT = {"sweeps.engine"}  # names for users


def engine_imports(path: Path) -> set[str]:
    """Return modules of the engine that one of its modules imports, wherever in it."""
    known = {name_of(one) for one in modules("sweeps/engine")}
    return {name for name in imports(path) if name in known} - {name_of(path), *FRONT}


@pytest.mark.parametrize("path", modules("sweeps/engine"), ids=name_of)
def test_engine_packages_import_only_from_lower_layers(path):
    if name_of(path) in FRONT:
        return
    level = {name: number for number, layer in enumerate(ENGINE_LAYERS) for name in layer}
    own = name_of(path).split(".")[2]
    others = {name.split(".")[2] for name in engine_imports(path)} - {own}
    assert all(level[other] < level[own] for other in others)


def test_engine_modules_have_no_import_cycles():
    left = {name_of(path): engine_imports(path) for path in modules("sweeps/engine")}
    while free := {name for name, needed in left.items() if not needed & left.keys()}:
        left = {name: needed for name, needed in left.items() if name not in free}
    assert left == {}


@pytest.mark.parametrize("path", modules("sweeps/engine"), ids=name_of)
def test_engine_never_mentions_the_experiment(path):
    text = path.read_text(encoding="utf-8")  # its comments, too
    assert [line for line in text.splitlines() if re.search(OF_THE_EXPERIMENT, line)] == []


def test_stores_and_caches_are_never_unpickled():
    paths = [path for package in OURS for path in modules(package)]
    users = {str(path.relative_to(ROOT)) for path in paths if "pickle" in imports(path)}
    assert users == {
        "studies/run_time/subprocess_call.py"
    }  # through a pipe to a process of its own


# Private names of other packages, by module; the module says why, and for which versions.
PRIVATE = {
    "ncti/classify/constraints.py": {"_fit_context", "_param_validation"},
    "ncti/compiled.py": {"_cache", "_cache_file", "_source_stamp"},
    "ncti/render/canvas.py": {
        *("_add_to_context", "_bind", "_display", "_eglQueryDeviceStringEXT", "_program_id"),
    },
}
DOCUMENTED = {"_exit", "_fields", "_replace"}  # names with an underscore that are public


def is_private(name):
    return name.startswith("_") and not name.startswith("__")


def test_uses_of_private_names_of_other_packages_are_listed():
    trees = {
        path.relative_to(ROOT).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
        for package in OURS
        for path in modules(package)
    }
    nodes = [(name, node) for name, tree in trees.items() for node in ast.walk(tree)]
    own = {node.name for _, node in nodes if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    used = {name: set() for name in trees}
    for name, node in nodes:
        if isinstance(node, ast.Attribute):
            of = node.value.func if isinstance(node.value, ast.Call) else node.value
            of_self = isinstance(of, ast.Name) and of.id in {"self", "cls", "super"}
            used[name] |= set() if of_self or node.attr in own else {node.attr}
        elif isinstance(node, ast.ImportFrom) and not (node.module or "").startswith(OURS):
            used[name] |= {*(node.module or "").split("."), *(one.name for one in node.names)}
    private = {name: set(filter(is_private, found)) - DOCUMENTED for name, found in used.items()}
    assert {name: found for name, found in private.items() if found} == PRIVATE


def test_every_library_that_is_imported_is_declared():
    """Undeclared ones would be missing as soon as no other library depends on them."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = [*project["dependencies"], *chain(*project["optional-dependencies"].values())]
    declared = {re.match(r"[\w-]+", one)[0].lower() for one in asked}
    offered = {name: {one.lower() for one in of} for name, of in packages_distributions().items()}
    # IPython runs the notebook that asks for it.
    here = {"IPython", "ncti", "studies", "sweeps", *sys.stdlib_module_names}
    for package in ("ncti", "sweeps", "studies"):
        for path in modules(package):
            for name in {one.partition(".")[0] for one in imports(path)} - here:
                # One that is not installed has the name of its distribution, as far as it is here.
                assert declared & offered.get(name, {name.lower().replace("_", "-")}), (path, name)
