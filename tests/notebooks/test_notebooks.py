"""Every notebook runs on a store of its own making, and draws something in every panel."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
STORES = {"flights": "flight_store"}  # fixtures; of all others the smoke experiment's

KEEP_FIGURES = "%matplotlib inline\n%config InlineBackend.close_figures = False"

LOOK_AT_FIGURES = """
import matplotlib.collections, matplotlib.pyplot, numpy

_figures = matplotlib.pyplot.get_fignums()
assert _figures, "no figure"
for _number in _figures:
    for _axes in matplotlib.pyplot.figure(_number).axes:
        # Points of lines and scatters, and values of pictures; error bars are not enough.
        _bars = [_part for _shown in _axes.containers if hasattr(_shown, "has_yerr")
                 for _part in (*_shown[1], *_shown[2])]
        _drawn = [_line.get_xydata() for _line in _axes.lines
                  if _line not in _bars and _line.get_transform() == _axes.transData]
        _drawn += [_shown.get_offsets() for _shown in _axes.collections
                   if isinstance(_shown, matplotlib.collections.PathCollection)]
        _pictures = [_shown.get_array() for _shown in (*_axes.images, *_axes.collections)]
        _drawn += [numpy.reshape(_picture, (-1, 1)) for _picture in _pictures
                   if _picture is not None]
        _drawn = [numpy.ma.filled(_one.astype(float), numpy.nan) for _one in _drawn]
        _drawn = [_one[numpy.isfinite(_one).all(axis=1)] for _one in _drawn]
        _where = f"figure {_number}, {_axes.get_title()!r}"
        assert any(len(numpy.unique(_one, axis=0)) > 1 for _one in _drawn), \
            f"{_where}: nothing drawn"
        _label = _axes.get_xlabel() or (hasattr(_axes, "_colorbar") and _axes.get_ylabel())
        assert _label, f"{_where}: no label on its axis"
"""


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_and_every_panel_shows_something(path, request, tmp_path, monkeypatch):
    store = request.getfixturevalue(STORES.get(path.stem, "smoke_store"))
    monkeypatch.setenv("NCTI_STORE", str(store))
    notebook = nbformat.read(path, as_version=4)
    new_cell = nbformat.v4.new_code_cell
    notebook.cells = [new_cell(KEEP_FIGURES), *notebook.cells, new_cell(LOOK_AT_FIGURES)]
    here = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=120, kernel_name="python3", resources=here).execute()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_says_what_is_missing(path, tmp_path, monkeypatch):
    monkeypatch.setenv("NCTI_STORE", str(tmp_path / "absent.zarr"))
    cells = nbformat.read(path, as_version=4).cells
    first = next(cell for cell in cells if cell.cell_type == "code")
    with pytest.raises(FileNotFoundError, match="run a sweep first, or set NCTI_STORE"):
        exec(first.source, {})


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_committed_without_outputs(path):
    for cell in nbformat.read(path, as_version=4).cells:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None
