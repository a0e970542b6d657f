"""Doctests of the library, collected as tests wherever `ncti` or a part of it is tested."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from _pytest.doctest import DoctestModule

LIBRARY = Path(__file__).parent / "ncti"


def pytest_collect_file(file_path: Path, parent: Any) -> DoctestModule | None:
    """Collect the examples in docstrings of a module of the library.

    `--doctest-modules` would import every module of every folder: tests, whose helpers have no
    examples, and `ncti.render.gl`, which binds OpenGL to a platform. Modules without an example
    are therefore never imported here.
    """
    if file_path.suffix != ".py" or LIBRARY not in file_path.parents:
        return None
    if parent.config.option.doctestmodules or ">>>" not in file_path.read_text(encoding="utf-8"):
        return None
    module: DoctestModule = DoctestModule.from_parent(parent, path=file_path)
    return module
