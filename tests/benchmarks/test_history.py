"""The history of error and time: its file, what the command appends, and its picture."""

import shutil
from itertools import groupby

import pytest

from benchmarks import history
from benchmarks.__main__ import main
from benchmarks.history import Entry


def test_the_file_of_the_repository_has_every_way_on_every_day():
    entries = history.read()
    assert entries
    assert [entry.date for entry in entries] == sorted(entry.date for entry in entries)
    for _, several in groupby(entries, key=lambda entry: (entry.date, entry.version)):
        assert {entry.way for entry in several} == set(history.WAYS)


def test_the_command_appends_a_measurement_and_draws_it(tmp_path, monkeypatch, capsys):
    """To a copy, of fewer views: errors in the order that sampling gives them."""
    file, drawn = tmp_path / "history.csv", tmp_path / "history.svg"
    shutil.copy(history.FILE, file)
    before = history.read(file)
    monkeypatch.setattr(history.record, "__kwdefaults__", {"file": file, "drawn": drawn})
    few = {"ships": ("duncan",), "aspects": (60.0,)}
    monkeypatch.setattr(history.measure, "__kwdefaults__", few)
    main(["history", "--repeats", "1"])
    after = history.read(file)
    assert after[: len(before)] == before
    new = {entry.way: entry for entry in after[len(before) :]}
    assert set(new) == set(history.WAYS)
    assert new["tolerance"].error < 100 * history.TOLERANCE < new["embree"].error
    assert new["lines"].bound > 1 and new["embree"].bound is None
    assert new["profile"].error is None and new["profile"].time > 0
    assert drawn.read_text(encoding="utf-8").count("simulate.range_profile") == 1
    assert "simulate.range_profile" in capsys.readouterr().out


def test_equal_entries_are_drawn_alike(tmp_path):
    entries = history.read()
    for name in ("a.svg", "b.svg"):
        history.picture(entries, tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ("date,version\n", "has columns"),
        ("date,version,way,error,worst,bound,time\n2026-01-01,1,guess,1,1,1,1\n", "way is 'guess'"),
        ("date,version,way,error,worst,bound,time\n2026-01-01,1,lines,-1,1,1,1\n", "error is -1"),
        ("date,version,way,error,worst,bound,time\nMonday,1,lines,1,1,1,1\n", "Monday"),
    ],
)
def test_a_damaged_file_is_refused_and_kept(wrong, named, tmp_path):
    file = tmp_path / "history.csv"
    file.write_text(wrong)
    entry = Entry("2026-01-01", "1", "lines", 0.1, 0.2, 2.0, 0.3)
    with pytest.raises(ValueError, match=named):
        history.append([entry], file)
    assert file.read_text() == wrong
