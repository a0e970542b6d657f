"""Two stores compared: pairs of answers on what both have, and nothing else."""

import numpy as np
import pytest
import xarray as xr
from made import categories, scores, shown
from pages import stored
from stores import reported, signed

from ncti.evaluate import paired_difference
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.report.compare import NAME, compare, sentences

ASPECTS = np.arange(0.0, 60.0, 3.0)


def store(path, right, aspects=ASPECTS, **swept):
    """A store of the answers of one classifier, (..., ship, aspect), and its table."""
    shown(scores(bins=("0-27", "30-57", "overall"), **swept)).to_zarr(
        path, group="tables/acn", consolidated=False
    )
    dims = (*(name for name, values in swept.items() if isinstance(values, list)), "ship", "aspect")
    coords = {"ship": ["duncan", "texas"], "aspect": aspects, **swept}
    answers = xr.Dataset({"correct": (dims, np.asarray(right, dtype="i1"))}, coords)
    answers.to_zarr(path, group="classification/acn", consolidated=False, mode="a")
    return signed(path)


@pytest.fixture
def answers():
    rng = np.random.default_rng(5)
    return rng.random((2, 2, 20)) < 0.7, rng.random((2, 20)) < 0.8


def test_differences_are_of_the_answers_in_common(answers, tmp_path):
    """Of two values and one, of aspects that one store lacks, of views without an answer."""
    several, one = answers
    first = store(tmp_path / "a.zarr", several, pulse_width=[10.0, 30.0])
    given = np.where(np.arange(19) == 4, -1, one[:, 1:])
    second = store(tmp_path / "b.zarr", given, ASPECTS[1:], pulse_width=30.0)
    rows = compare(first, second)[NAME].rows
    assert set(rows.pulse_width) == {30.0}
    asked = given >= 0
    wanted = paired_difference(several[1][:, 1:], given == 1, ASPECTS[1:], draws=0, answered=asked)
    for name, values in (
        ("difference", wanted.fraction),
        ("ci_low", wanted.ci_low),
        ("ci_high", wanted.ci_high),
    ):
        np.testing.assert_allclose(rows[name], 100 * values, rtol=1e-12)
    assert rows.n.tolist() == wanted.n.tolist() == [16, 20, 36]


def test_the_other_way_round_is_the_opposite(answers, tmp_path):
    paths = [store(tmp_path / f"{k}.zarr", right) for k, right in enumerate(answers[0])]
    rows, opposite = compare(*paths)[NAME].rows, compare(*reversed(paths))[NAME].rows
    np.testing.assert_allclose(rows.difference, -opposite.difference)
    np.testing.assert_allclose(rows.ci_low, -opposite.ci_high)


@pytest.mark.parametrize("better", [0, 1])
def test_differences_beyond_their_intervals_are_counted_either_way(better, tmp_path):
    right = np.arange(40).reshape(2, 20) % 10 > 0  # nine in ten, and one
    paths = [store(tmp_path / f"{k}.zarr", right if k == better else ~right) for k in range(2)]
    [said] = sentences(compare(*paths))
    assert (
        said.startswith("1 of 1 differences") and f"{'-' if better == 0 else '+'}80 points" in said
    )


def test_the_command_prints_and_writes_them(answers, tmp_path, monkeypatch, capsys):
    several, one = answers
    paths = store(tmp_path / "a.zarr", several[0]), store(tmp_path / "b.zarr", one)
    assert reported(monkeypatch, *paths, "--html") == 0
    text = capsys.readouterr().out
    assert "b.zarr less a.zarr" in text
    made = {path.name for path in tmp_path.iterdir()}
    assert made == {"a.zarr", "b.zarr", "b-less-a-tables", "b-less-a-report.html"}
    page = (tmp_path / "b-less-a-report.html").read_text()
    assert page.index("b.zarr less a.zarr") < page.index("Ships identified correctly [%]")


def test_stores_without_answers_in_common_are_refused(answers, tmp_path, monkeypatch, capsys):
    first = store(tmp_path / "a.zarr", answers[1])
    second = store(tmp_path / "b.zarr", answers[1], ASPECTS + 0.5)
    with pytest.raises(ConfigurationError, match="in common"):
        compare(first, second)
    capsys.readouterr()  # zarr warns of texts when they are written
    assert reported(monkeypatch, first, second) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_learned_aspects_and_others_are_apart_and_other_tables_are_subtracted(answers, tmp_path):
    learned = xr.Dataset(coords={"learned": ("aspect", ASPECTS < 30), "aspect": ASPECTS})
    paths = [tmp_path / "a.zarr", tmp_path / "b.zarr"]
    for path, right, count in zip(paths, answers[0], (7, 9), strict=True):
        store(path, right)
        about = {"configuration": {"grid": {"random_aspects": 0}}, "seed": 0}
        formed = categories(count, pulse_width=[10.0, 30.0])
        stored(path, about, range_profile=learned, tables__formed=formed)
    found = compare(*paths)
    rows = found[NAME].rows
    assert rows.groupby("aspects").n.max().to_dict() == {"between": 20, "learned": 20}
    assert (found[f"categories_{NAME}"].rows.categories == 2).all()
