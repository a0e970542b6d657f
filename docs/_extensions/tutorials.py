"""The notebooks as tutorials: copied beside the pages, with the stores that they open."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import nbformat

FOLDER = "tutorials"
STORES = {
    "smoke": ["+experiment=smoke"],
    "flights": [
        "sensor=irar",
        "grid.ship=roberts",
        "grid.aspect=[165,175]",
        "grid.replicate=2",
        "irar.cnr=[5,20]",
        "irar.range_filter=[cluster,median,mean]",
    ],
}
NOTEBOOK_STORES = {"flights": "flights"}
"""Stores of notebooks; of all others the smoke experiment's."""


def make_store(name: str, folder: Path) -> Path:
    """Make a store by name, with a cache kept between builds, and return its path."""
    shutil.rmtree(folder / f"{name}.zarr", ignore_errors=True)  # of other code it would be refused
    folder.mkdir(parents=True, exist_ok=True)
    places = [f"store={name}.zarr", f"cache={folder / 'cache'}"]
    command = [sys.executable, "-m", "sweeps.app", *STORES[name], *places]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if result.returncode:
        raise RuntimeError(f"{' '.join(command)} failed: {result.stderr}")
    return folder / f"{name}.zarr"


def copy_notebooks(app: Any) -> None:
    """Copy the notebooks that have changed, with a hidden cell that names the store."""
    source, target = Path(app.srcdir).parent / "notebooks", Path(app.srcdir) / FOLDER
    target.mkdir(exist_ok=True)
    paths = sorted(source.glob("*.ipynb"))
    names = {path: NOTEBOOK_STORES.get(path.stem, "smoke") for path in paths}
    stores = {
        name: make_store(name, Path(app.outdir).parent / "stores") for name in {*names.values()}
    }
    for path, name in names.items():
        notebook = nbformat.read(path, as_version=4)
        cell = nbformat.v4.new_code_cell(
            f"import os\n\nos.environ['NCTI_STORE'] = {str(stores[name])!r}",
            id="store",
            metadata={"tags": ["remove-cell"]},
        )
        notebook.cells.insert(1, cell)
        text, copy = nbformat.writes(notebook), target / path.name
        if not copy.exists() or copy.read_text(encoding="utf-8") != text:
            copy.write_text(text, encoding="utf-8")


def link_copies(app: Any, docname: str, source: list[str]) -> None:
    """Redirect links to the notebooks of the repository to their copies."""
    folder = "../" * docname.count("/") + FOLDER
    source[0] = re.sub(r"\]\((?:\.\./)+notebooks/(\w+\.ipynb)", rf"]({folder}/\1", source[0])


def setup(app: Any) -> dict[str, Any]:
    """Copy the notebooks before Sphinx looks for pages."""
    app.connect("builder-inited", copy_notebooks)
    app.connect("source-read", link_copies)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
