"""The layer rule of CONTRIBUTING.md, proven on the imports themselves."""

import ast
import re
from pathlib import Path

import networkx
import pytest

ROOT = Path(__file__).resolve().parent.parent

# What each room of the library may import of it.
ALLOWED = {
    "ncti.checks": set(),
    "ncti.machine_code": set(),
    "ncti.compiled": {"ncti.machine_code"},
    "ncti.normals": {"ncti.compiled"},
    "ncti.ships": {"ncti.checks"},
    "ncti.render": {"ncti.checks", "ncti.compiled", "ncti.machine_code", "ncti.ships"},
    "ncti.ladar": {
        *("ncti.checks", "ncti.compiled", "ncti.machine_code", "ncti.normals", "ncti.ships"),
        "ncti.render",
    },
    "ncti.infrared": {
        *("ncti.checks", "ncti.compiled", "ncti.machine_code", "ncti.ships", "ncti.render"),
    },
    "ncti.irar": {
        *("ncti.checks", "ncti.compiled", "ncti.machine_code", "ncti.ships", "ncti.render"),
        *("ncti.ladar", "ncti.infrared"),
    },
    "ncti.search": {"ncti.checks", "ncti.ladar", "ncti.infrared"},
    "ncti.features": {"ncti.checks", "ncti.ships", "ncti.render", "ncti.ladar", "ncti.infrared"},
    "ncti.simulate": {
        *("ncti.checks", "ncti.ships", "ncti.render", "ncti.ladar", "ncti.infrared", "ncti.irar"),
    },
    "ncti.classify": {"ncti.checks"},
    "ncti.evaluate": {"ncti.checks"},
}
FOREIGN = {"hydra", "omegaconf", "dask", "distributed", "zarr", "sweeps"}

# What each room of the sweeps may import of this project; nobody imports `sweeps.app`.
ROOMS = {
    "sweeps.engine": {"sweeps.engine"},
    "sweeps.stages": {"sweeps.engine", "sweeps.stages", "ncti"},
    "sweeps.experiment": {"sweeps.engine", "sweeps.stages"},
    "sweeps.ahead": {"sweeps.engine", "sweeps.experiment"},
    "sweeps.report": {"sweeps.engine", "sweeps.stages", "sweeps.report", "ncti"},
    "sweeps.app": {"sweeps.engine", "sweeps.stages", "sweeps.report", "sweeps.experiment"},
}
ONLY_THE_ENGINE = FOREIGN - {"sweeps"}
ALLOWED_OTHERS = {("sweeps.report", "zarr")}  # it reads stores
OF_THE_EXPERIMENT = (
    r"(?i)(?<![a-z])(aspects?|pulse_?widths?|ladar|irar|infrared|ships?|silhouettes?|vigilances?|"
    r"frame_counts?|receivers?|classifiers?|ncti)(?![a-z])"
)

LONGEST_CHAIN = 11
"""Modules of `sweeps` on the longest way from the command down, each of which imports the next."""

LONGEST_MODULE = 400


def room(module: str) -> str:
    return ".".join(module.split(".")[:2])


def imports(path: Path) -> set[str]:
    """Absolute names of all modules that a file imports, wherever in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} has a relative import"
            assert node.module is not None
            # `from ncti import ladar` names a room in its alias
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def violations(path: Path) -> list[str]:
    own = room(".".join(path.relative_to(ROOT).with_suffix("").parts))
    found = []
    for name in imports(path):
        top = name.split(".")[0]
        if top in FOREIGN:
            found.append(f"{own} imports {name}")
        if top == "ncti" and own != "ncti.__init__" and name != "ncti":
            other = room(name)
            if other in ALLOWED and other != own and other not in ALLOWED[own]:
                found.append(f"{own} imports {name}")
    return found


@pytest.mark.parametrize("path", modules("ncti"), ids=lambda p: str(p.relative_to(ROOT)))
def test_library_imports_go_one_way(path):
    assert violations(path) == []


def test_every_room_has_a_rule():
    rooms = {
        room(".".join(path.relative_to(ROOT).with_suffix("").parts)) for path in modules("ncti")
    }
    assert rooms - {"ncti.__init__"} == set(ALLOWED)


def test_a_violation_would_be_found(tmp_path, monkeypatch):
    monkeypatch.setattr("test_architecture.ROOT", tmp_path)
    bad = tmp_path / "ncti" / "render" / "bad.py"
    bad.parent.mkdir(parents=True)
    bad.write_text("def f():\n    from ncti.ladar import range_extent\n    import zarr\n")
    assert len(violations(bad)) >= 2


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def broken(path: Path) -> list[str]:
    """Imports of a module of the sweeps that its room may not have."""
    own = room(name_of(path))
    found = []
    for name in imports(path):
        top = name.split(".")[0]
        if top in ("ncti", "sweeps", "benchmarks") and name != "sweeps":
            other = top if top == "ncti" else room(name)
            if other not in ROOMS[own]:
                found.append(f"{own} imports {name}")
        if top in ONLY_THE_ENGINE and own != "sweeps.engine" and (own, top) not in ALLOWED_OTHERS:
            found.append(f"{own} imports {name}")
    return found


@pytest.mark.parametrize("path", modules("sweeps"), ids=lambda p: str(p.relative_to(ROOT)))
def test_sweeps_import_one_way(path):
    if path.parent.name != "sweeps" or path.name != "__init__.py":
        assert broken(path) == []


def test_a_way_back_would_be_found(tmp_path, monkeypatch):
    monkeypatch.setattr("test_architecture.ROOT", tmp_path)
    for name, line in {
        "sweeps/engine/bad.py": "from sweeps.stages import views",
        "sweeps/engine/worse.py": "import ncti.ladar",
        "sweeps/stages/bad.py": "from sweeps.report import tables",
        "sweeps/report/bad.py": "def f():\n    import hydra",
        "sweeps/experiment.py": "from sweeps import app",
    }.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(line)
        assert broken(path) != [], name


def words_of(path: Path) -> set[str]:
    """Every name and text of a module, but for docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    plain = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    found = set()
    for node in ast.walk(tree):
        for field in ("id", "attr", "arg", "name"):
            found.add(getattr(node, field, None))
        if isinstance(node, ast.Constant) and id(node) not in plain:
            found.add(node.value)
    return {word for word in found if isinstance(word, str)}


@pytest.mark.parametrize("path", modules("sweeps/engine"), ids=lambda p: p.name)
def test_the_engine_has_no_word_of_the_experiment(path):
    text = path.read_text(encoding="utf-8")  # its comments, too
    assert [line for line in text.splitlines() if re.search(OF_THE_EXPERIMENT, line)] == []


def test_words_of_the_experiment_would_be_found():
    stages = {name for path in modules("sweeps/stages") for name in words_of(path)}
    found = {word for word in stages if re.search(OF_THE_EXPERIMENT, word)}
    assert {"aspect", "pulse_width", "Ladar", "target_free_ifovs"} & found == {
        *("aspect", "pulse_width", "Ladar")
    }
    assert not re.search(OF_THE_EXPERIMENT, "relationship of what is received")


def test_the_longest_chain_of_imports_does_not_grow():
    paths = {name_of(path): path for path in modules("sweeps") if path.name != "__init__.py"}
    graph = networkx.DiGraph(
        (name, other) for name, path in paths.items() for other in imports(path) & set(paths)
    )
    floors = networkx.condensation(graph)
    for circle in (floors.nodes[one]["members"] for one in floors):
        assert len(circle) == 1
    chain = [min(floors.nodes[one]["members"]) for one in networkx.dag_longest_path(floors)]
    assert len(chain) <= LONGEST_CHAIN, " -> ".join(chain)


@pytest.mark.parametrize("path", modules("ncti") + modules("sweeps"), ids=lambda p: p.name)
def test_modules_stay_readable(path):
    longest = 420 if name_of(path).startswith("ncti") else LONGEST_MODULE
    assert len(path.read_text(encoding="utf-8").splitlines()) <= longest
    assert path.stem not in {"utils", "misc", "helpers", "common"}
