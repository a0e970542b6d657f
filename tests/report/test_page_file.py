"""The report page is written whole, and again after changes; it shows run times and ships."""

import base64
import errno
import io
import os
import shutil

import numpy as np
import xarray as xr
import zarr
from made import scores
from pages import page_of, parsed, stored
from PIL import Image
from stores import reported

from sweeps.engine.objects import Objects
from sweeps.engine.run.schedule import Progress
from sweeps.report.outputs import page_file
from sweeps.report.page import write
from sweeps.report.page.write import write_store_page
from sweeps.report.pictures import describe_ships
from sweeps.report.summary import tables_of
from sweeps.report.timings import read_timings, write_timings


def test_page_is_written_atomically(tmp_path, monkeypatch, capsys):
    path = stored(tmp_path / "s.zarr", tables__o=scores(a=[1, 2]))
    assert reported(monkeypatch, "--html", path) == 0
    before = page_file(path).read_bytes()
    capsys.readouterr()

    def cut(self, content):
        with self.open("wb") as file:
            file.write(content[:100])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", cut)
    assert reported(monkeypatch, "--html", path) == 2
    message = capsys.readouterr().err
    assert (
        message.startswith("ncti-report: the report page is not written: ")
        and message.count("\n") == 1
    )
    assert page_file(path).read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir() if "partial" in entry.name] == []


def test_a_page_is_written_again_when_the_store_or_the_report_changes(tmp_path, monkeypatch):
    path = stored(tmp_path / "s.zarr", {"seed": 1}, tables__o=scores(a=[1, 2]))
    copy = tmp_path / "report"
    shutil.copytree(write.FOLDER, copy)
    monkeypatch.setattr(write, "FOLDER", copy)
    assert not write.is_current(path)
    assert write_store_page(path, tables_of(path)) == [] and write.is_current(path)
    stored(path, {"seed": 2})
    assert not write.is_current(path)
    for name in ("page/templates/page.js", "frames.py"):
        assert write_store_page(path, tables_of(path)) == [] and write.is_current(path)
        with (copy / name).open("a") as file:
            file.write("\n")
        assert not write.is_current(path)


def test_read_error_is_not_reported_as_an_invalid_store(tmp_path, monkeypatch, capsys):
    path, get = stored(tmp_path / "s.zarr", tables__o=scores(a=[1, 2])), Objects.get

    def short(objects, wanted):
        if wanted == "manifest":
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE), wanted)
        return get(objects, wanted)

    monkeypatch.setattr(Objects, "get", short)
    assert reported(monkeypatch, path) == 2
    sentence = f"ncti-report: store is '{path}', which cannot be read: Too many open files\n"
    assert capsys.readouterr().err == sentence


def test_run_times_are_stored_and_shown_on_the_page(tmp_path):
    path = stored(tmp_path / "s.zarr", tables__o=scores(a=[1, 2]))
    assert read_timings(path) is None
    write_timings(
        path, {"fast": Progress(total=3, reused=2, done=1, seconds=0.25), "=x": Progress(1)}
    )
    timings = read_timings(path)
    assert timings.rows.iloc[0].tolist() == ["fast", 1, 2, 0, 0.25]
    text = parsed(page_of(path)).root.only("section", id="configuration").text
    assert "Run time of the last sweep by stage" in text and "fast" in text


def test_ships_have_their_measures_and_a_picture(tmp_path):
    picture = np.full((2, 3, 5), np.nan)
    picture[0, 0] = 1.0  # a bright keel, in the lowest row
    table = xr.Dataset(
        {
            "length": ("ship", [135.62, 20.0]),
            "facets": ("ship", [43672, 12]),
            "picture": (("ship", "row", "column"), picture),
            "warning": ("ship", ["", "stands on its stern"]),
        },
        {"ship": ["duncan", "own"]},
    )
    table.length.attrs["units"] = "m"
    path = stored(tmp_path / "s.zarr", ships=table, tables__o=scores(a=[1, 2]))
    duncan, own = describe_ships(zarr.open_group(path))
    assert own["picture"] == "" and own["warning"] == "stands on its stern"
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(duncan["picture"]))))
    assert pixels.shape == (3, 5, 4)
    assert (pixels[2, :, 3] == 255).all() and (pixels[:2, :, 3] == 0).all()
    page = parsed(page_of(path))
    text = page.root.only("section", id="ships").text
    assert "duncan: length 135.6 m, facets 43,672" in text
    assert "own: length 20.0 m, facets 12" in text
