"""The layer rule of CONTRIBUTING.md, proven on the imports themselves."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

# What each room of the library may import of it.
ALLOWED = {
    "ncti.checks": set(),
    "ncti.ships": {"ncti.checks"},
    "ncti.render": {"ncti.checks", "ncti.ships"},
    "ncti.ladar": {"ncti.checks", "ncti.ships", "ncti.render"},
    "ncti.infrared": {"ncti.checks", "ncti.ships", "ncti.render"},
    "ncti.irar": {"ncti.checks", "ncti.ships", "ncti.render", "ncti.ladar", "ncti.infrared"},
    "ncti.features": {"ncti.checks", "ncti.ships", "ncti.render", "ncti.ladar", "ncti.infrared"},
    "ncti.classify": {"ncti.checks"},
    "ncti.evaluate": {"ncti.checks"},
}
FOREIGN = {"hydra", "omegaconf", "dask", "distributed", "zarr", "sweeps"}


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


@pytest.mark.parametrize("path", modules("ncti") + modules("sweeps"), ids=lambda p: p.name)
def test_modules_stay_readable(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 420
    assert path.stem not in {"utils", "misc", "helpers", "common"}
