"""Every notebook runs on a small store, and draws something in every panel."""

from pathlib import Path

import matplotlib as mpl
import nbformat
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.collections import PathCollection

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
STORES = {"flights": "flight_store"}  # fixtures; all others open the smoke experiment's


def code_of(path):
    """Return the sources of the code cells."""
    cells = nbformat.read(path, as_version=4).cells
    return [cell.source for cell in cells if cell.cell_type == "code"]


def shown(axes):
    """Yield points of lines and scatters, and values of pictures, but no error bars."""
    containers = [one for one in axes.containers if hasattr(one, "has_yerr")]
    bars = [part for one in containers for part in (*one[1], *one[2])]
    for line in axes.lines:
        if line not in bars and line.get_transform() == axes.transData:
            yield line.get_xydata()
    for one in (*axes.images, *axes.collections):
        if isinstance(one, PathCollection):
            yield one.get_offsets()
        if one.get_array() is not None:
            yield np.reshape(one.get_array(), (-1, 1))


@pytest.mark.usefixtures("quick_layout")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_and_every_panel_shows_something(path, request, tmp_path, monkeypatch):
    """It runs in this process; the site's build runs it in a kernel of its own."""
    store = request.getfixturevalue(STORES.get(path.stem, "smoke_store"))
    monkeypatch.setenv("NCTI_STORE", str(store))
    monkeypatch.chdir(tmp_path)
    mpl.use("Agg")
    plt.close("all")
    namespace = {"__name__": "__main__"}
    for source in code_of(path):
        exec(compile(source, path.name, "exec"), namespace)
    figures = [plt.figure(number) for number in plt.get_fignums()]
    assert figures
    for axes in (axes for figure in figures for axes in figure.axes):
        drawn = [np.ma.filled(one.astype(float), np.nan) for one in shown(axes)]
        finite = [one[np.isfinite(one).all(axis=1)] for one in drawn]
        assert any(len(np.unique(one, axis=0)) > 1 for one in finite), axes.get_title()
        assert axes.get_xlabel() or (hasattr(axes, "_colorbar") and axes.get_ylabel())
    plt.close("all")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_explains_a_missing_store(path, tmp_path, monkeypatch):
    monkeypatch.setenv("NCTI_STORE", str(tmp_path / "absent.zarr"))
    with pytest.raises(FileNotFoundError, match="run a sweep first, or set NCTI_STORE"):
        exec(code_of(path)[0], {})


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_committed_without_outputs(path):
    for cell in nbformat.read(path, as_version=4).cells:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None
