"""Stores are compared by pairs of answers to the views that both have, and by nothing else."""

import shutil

import numpy as np
import pytest
import xarray as xr
from made import categories, displayed, scores
from pages import read_page, stored
from scipy import stats
from stores import contents, reported, signed

from ncti.evaluate import paired_difference
from sweeps.report.changes import change_sentences, change_table, settings_sentence
from sweeps.report.compare import NAME, compare
from sweeps.report.page.content import comparison_content
from sweeps.report.pairs import Pairs, holm

ASPECTS = np.arange(0.0, 60.0, 3.0)


def store(path, right, aspects=ASPECTS, **swept):
    """Write a store of one classifier's answers, (..., ship, aspect), and its table."""
    displayed(scores(bins=("0-27", "30-57", "overall"), **swept)).to_zarr(
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


def test_differences_use_only_shared_answers(answers, tmp_path):
    """One store has a second pulse width; the other lacks an aspect, and answers at another."""
    at_widths, single = answers
    first = store(tmp_path / "a.zarr", at_widths, pulse_width=[10.0, 30.0])
    correct = np.where(np.arange(19) == 4, -1, single[:, 1:])
    second = store(tmp_path / "b.zarr", correct, ASPECTS[1:], pulse_width=30.0)
    rows = compare(first, second).frames[NAME].rows
    assert set(rows.pulse_width) == {30.0}
    answered = correct >= 0
    expected = paired_difference(
        at_widths[1][:, 1:], correct == 1, ASPECTS[1:], draws=0, answered=answered
    )
    for name, values in (
        ("difference", expected.fraction),
        ("ci_low", expected.ci_low),
        ("ci_high", expected.ci_high),
    ):
        np.testing.assert_allclose(rows[name], 100 * values, rtol=1e-12)
    assert rows.n.tolist() == expected.n.tolist() == [16, 20, 36]


@pytest.mark.parametrize("better", [0, 1])
def test_largest_change_is_reported_for_gain_and_loss(better, tmp_path):
    right = np.arange(40).reshape(2, 20) % 10 > 0  # nine in ten; negated, one in ten
    paths = [store(tmp_path / f"{k}.zarr", right if k == better else ~right) for k in range(2)]
    sentence, chance = change_sentences(compare(*paths))
    ends, sign = (("90", "10"), "-") if better == 0 else (("10", "90"), "+")
    expected = "The largest difference beyond chance is that of ACN, range profile: "
    expected += f"from {ends[0]} % in 0.zarr to {ends[1]} % in 1.zarr, {sign}80 points [{sign}"
    assert sentence.startswith(expected)
    assert chance == "Comparisons significant by Holm's correction at 5 %: 1 of 1."


def test_insignificant_difference_is_not_reported_as_largest(tmp_path):
    """In one cell the answers to 2 of 4 views change, and in the other to 16 of 40."""
    paths = []
    for name, few, many in (("a", 2, 10), ("b", 4, 26)):
        right = np.full((2, 40), -1)
        right[0, :4], right[1] = np.arange(4) < few, np.arange(40) < many
        cells = right.reshape(2, 2, 20)
        paths.append(store(tmp_path / f"{name}.zarr", cells, pulse_width=[10.0, 30.0]))
    compared = compare(*paths)
    rows = compared.frames[NAME].rows
    assert rows.loc[rows.difference.abs().idxmax(), "pulse_width"] == 10.0
    sentence, counted = change_sentences(compared)
    assert sentence.startswith(
        "The largest difference beyond chance is that of ACN, range profile, at "
    )
    assert "at pulse width 30: from 25 % in a.zarr to 65 % in b.zarr, +40 points" in sentence
    assert counted.endswith(": 1 of 2.")


def test_changes_only_in_training_answers_are_reported_as_such(answers, tmp_path):
    paths = [store(tmp_path / f"{k}.zarr", answers[1]) for k in range(2)]
    for path, right in zip(paths, answers[0], strict=True):
        coords = {"ship": ["duncan", "texas"], "aspect": ASPECTS}
        learned = xr.Dataset({"training_correct": (("ship", "aspect"), right.astype("i1"))}, coords)
        stored(
            path, classification__acn=learned, tables__acn=displayed(scores(prefixes=["training_"]))
        )
    sentence, equal = change_sentences(compare(*paths))
    assert sentence.startswith("ACN, range profile changed most: from ")
    assert equal == "All answers of tests are equal; only those at learned aspects changed."


def test_command_prints_and_writes_the_comparison(answers, tmp_path, monkeypatch, capsys):
    at_widths, single = answers
    paths = store(tmp_path / "a.zarr", at_widths[0]), store(tmp_path / "b.zarr", single)
    assert reported(monkeypatch, *paths, "--html") == 0
    text = capsys.readouterr().out
    assert "% in a.zarr to " in text and len(text.splitlines()) < 15
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"a.zarr", "b.zarr", "b-less-a-tables", "b-less-a-report.html"}
    page = read_page(tmp_path / "b-less-a-report.html")
    assert page.root.only("h1").text == "b.zarr less a.zarr"
    assert page.data["tables"][NAME]["figures"]["difference"]["difference"]
    policy = page.root.only("meta", http_equiv="Content-Security-Policy").attrs["content"]
    assert policy.startswith("default-src 'none'")


def test_comparison_separates_learned_aspects_and_subtracts_tables(answers, tmp_path):
    learned = xr.Dataset(coords={"learned": ("aspect", ASPECTS < 30), "aspect": ASPECTS})
    paths = [tmp_path / "a.zarr", tmp_path / "b.zarr"]
    for path, right, count in zip(paths, answers[0], (7, 9), strict=True):
        store(path, right)
        attrs = {"configuration": {"grid": {"random_aspects": 0}}, "seed": 0}
        formed = categories(count, pulse_width=[10.0, 30.0])
        stored(path, attrs, range_profile=learned, tables__formed=formed)
    frames = compare(*paths).frames
    rows = frames[NAME].rows
    assert rows.groupby("aspects").n.max().to_dict() == {"between": 20, "learned": 20}
    assert (frames[f"categories_{NAME}"].rows.categories == 2).all()


def _family(rng, cells, change):
    """Return pairs of answers to 40 views in some cells, with another rate in the first cell."""
    rate = np.full((cells, 1, 1), 0.5)
    rate[0] += change
    answers = [rng.random((cells, 2, 20)) < share for share in (0.5, rate)]
    coords = {"ship": ["duncan", "texas"], "aspect": ASPECTS}
    return Pairs(
        *(
            xr.DataArray(correct.astype("i1"), coords, ("cell", "ship", "aspect"))
            for correct in answers
        )
    )


def test_holm_controls_the_familywise_error_rate():
    """At most 5 % of 200 families of 25 null comparisons may err, by a test at 1e-4."""
    rng = np.random.default_rng(7)
    erred = sum(bool(holm([_family(rng, 25, 0.0)])[0][0].any()) for _ in range(200))
    assert stats.binom.sf(erred - 1, 200, 0.05) > 1e-4, erred


def test_holm_steps_down():
    """Bisection finds the largest confidence whose interval excludes 0, and so each p-value."""
    rng = np.random.default_rng(9)
    pairs = _family(rng, 12, 0.5)
    pairs = Pairs(pairs.first, pairs.second | (rng.random(pairs.first.shape) < 0.5).astype("i1"))
    low, high = np.zeros(12), np.ones(12)
    for _ in range(20):
        middle = (low + high) / 2
        beyond = np.array([0 < c < 1 and pairs.excludes_zero(c)[k] for k, c in enumerate(middle)])
        low, high = np.where(beyond, middle, low), np.where(beyond, high, middle)
    p = np.sort(1 - low)
    refused = p <= 0.05 / (12 - np.arange(12))
    expected = 12 if refused.all() else int(np.argmin(refused))
    assert 0 < expected < 12 and int(holm([pairs])[0][0].sum()) == expected
    equal = Pairs(pairs.first, pairs.first)  # is not counted
    assert holm([pairs, equal])[1] == 12 and holm([equal])[1] == 0


def test_equal_stores_are_reported_in_one_sentence(tmp_path, monkeypatch, capsys):
    """Files of an earlier comparison go, unless others wrote them."""
    paths = _trees(tmp_path, [5.0], [6.0])
    assert reported(monkeypatch, *paths, "--html") == 0
    page, folder = tmp_path / "b-less-a-report.html", tmp_path / "b-less-a-tables"
    (folder / "mine.csv").write_text("1")
    assert page.is_file() and (folder / "tree_differences.csv").is_file()
    for path in paths:
        shutil.rmtree(path)
    _trees(tmp_path, [5.0], [5.0], failures=[{}, {"size=2": "ValueError"}])
    for options in ([], ["--html"], ["--table", "differences"]):
        capsys.readouterr()
        assert reported(monkeypatch, *paths, *options) == 0
        text = capsys.readouterr().out
        assert text.startswith("b.zarr and a.zarr have the same results wherever both have any.\n")
        assert "failed  1 cell of b.zarr: the comparison covers the others" in text
    assert not page.exists() and set(contents(folder)) == {"mine.csv"}


def _trees(tmp_path, *heights, sizes=(1.0, 2.0, 3.0), **about):
    """Write stores of a table of heights by size, with attributes, and return their paths."""
    paths = [tmp_path / f"{'abc'[k]}.zarr" for k in range(len(heights))]
    for k, (path, figures) in enumerate(zip(paths, heights, strict=True)):
        table = xr.Dataset({"height": ("size", figures)}, {"size": list(sizes[: len(figures)])})
        stored(path, {key: values[k] for key, values in about.items()}, tables__tree=table)
    return paths


def test_value_missing_in_one_store_counts_as_changed(tmp_path):
    nan = float("nan")
    compared = compare(*_trees(tmp_path, [5.0, nan, nan], [5.0, nan, 7.0]))
    sentence = change_sentences(compared)[0]
    assert (
        sentence
        == "Of tree, height changed most, at size 3: from no value in a.zarr to 7 in b.zarr."
    )
    (*_, last) = change_table(compared, ["size"]).lines
    assert [cell.text for cell in last.cells] == ["–", "7", "–"]


def test_same_named_ships_with_different_meshes_are_listed(tmp_path):
    digests = [{"duncan": "1", "horne": "2"}, {"duncan": "1", "horne": "3", "texas": "4"}]
    paths = _trees(tmp_path, [5.0], [6.0], mesh_digests=digests, configuration=[{}, {}])
    sentence = "All settings are the same. Ships that differ: horne."
    assert settings_sentence(compare(*paths)) == sentence
    moved = [{"duncan": "offset 1"}, {}]
    paths = _trees(
        tmp_path / "moved", [5.0], [6.0], mesh_digests=[digests[0]] * 2, mesh_transforms=moved
    )
    assert settings_sentence(compare(*paths)).endswith(" Ships that differ: duncan.")


def test_classifiers_that_do_not_differ_are_left_out(answers, tmp_path):
    paths = [store(tmp_path / f"{k}.zarr", right) for k, right in enumerate(answers[0])]
    for path in paths:
        equal = xr.Dataset(
            {"correct": (("ship", "aspect"), answers[1].astype("i1"))},
            {"ship": ["duncan", "texas"], "aspect": ASPECTS},
        )
        table = xr.Dataset({"length": ("size", [1.0, 2.0])}, {"size": [1.0, 2.0]})
        tables = {"tables__mnn": displayed(scores(), "mnn"), "tables__same": table}
        stored(path, classification__mnn=equal, **tables)
    compared = compare(*paths)
    assert set(compared.frames[NAME].rows.classifier) == {"acn"} and [*compared.frames] == [NAME]
    assert compared.number == 1


def test_change_table_has_at_most_ten_rows(tmp_path):
    widths = [float(10 * k) for k in range(1, 25)]
    rng = np.random.default_rng(3)
    right = [rng.random((24, 2, 20)) < share for share in (0.9, 0.6, 0.3)]
    paths = [
        store(tmp_path / f"{'abc'[k]}.zarr", correct, pulse_width=widths)
        for k, correct in enumerate(right)
    ]
    two = change_table(compare(*paths[:2]), ["pulse_width"])
    assert two.heads == ("a.zarr", "b.zarr", "difference") and len(two.lines) == 10
    first, *_, last = two.lines
    for line, place in ((first, 0), (last, 23)):
        assert line.place == (widths[place],)
        ends = [100 * correct[place].mean() for correct in right[:2]]
        assert [cell.text for cell in line.cells[:2]] == [f"{end:.0f}" for end in ends]
        assert line.cells[2].text == f"{ends[1] - ends[0]:+.0f}" and line.cells[2].interval
    three = change_table(compare(*paths), ["pulse_width"])
    assert three.heads == ("b.zarr", "c.zarr") and "other stores less a.zarr" in three.title
    cells = [cell.text for cell in three.lines[0].cells]
    assert cells == [
        f"{100 * (correct[0].mean() - right[0][0].mean()):+.0f}" for correct in right[1:]
    ]
    sentence, _ = change_sentences(compare(*paths))
    assert " in c.zarr, -" in sentence and "at pulse width " in sentence


@pytest.mark.parametrize("changed", [0, 1])
def test_comparison_page_initially_selects_the_largest_change(changed, tmp_path):
    """The page selects the frame count whose answers changed, not a preferred one."""
    right = np.ones((3, 2, 2, 20))
    wrong = right.copy()
    wrong[:, changed] = 0
    swept = {"pulse_width": [10.0, 30.0, 50.0], "frame_count": [4, 16]}
    first, second = (
        store(tmp_path / name, correct, **swept)
        for name, correct in (("a.zarr", right), ("b.zarr", wrong))
    )
    axes = comparison_content(compare(first, second))["axes"]
    [options] = (axis["options"] for axis in axes if axis["name"] == "frame_count")
    assert [selected for *_, selected in options] == [changed == 0, changed == 1]


def test_any_experiment_is_compared_at_shared_axis_values(tmp_path):
    paths = [tmp_path / "a.zarr", tmp_path / "b.zarr"]
    values = [1.0, 2.0, 3.0], [2.0, 3.0, 4.0]
    for path, sizes, figures in zip(paths, values, ([5.0, 6.0, 7.0], [6.5, 9.0, 1.0]), strict=True):
        table = xr.Dataset({"height": ("size", figures)}, {"size": sizes})
        table.height.attrs["units"] = "m"
        stored(path, {"configuration": {"depth": sizes[0]}, "seed": 1}, tables__tree=table)
    compared = compare(*paths)
    texts = change_sentences(compared)
    assert (
        texts[0]
        == "Of tree, height changed most, at size 3: from 7 m in a.zarr to 9 m in b.zarr, +2 m."
    )
    assert "no intervals" in texts[1] and len(texts) == 2
    assert [line.place for line in change_table(compared, ["size"]).lines] == [(2.0,), (3.0,)]
    assert settings_sentence(compared) == "Settings that differ: depth 1 in a.zarr and 2 in b.zarr."


def test_single_axis_values_are_compared_even_if_they_differ(answers, tmp_path):
    paths = [
        store(tmp_path / f"{k}.zarr", right[None], pulse_width=[width])
        for k, (right, width) in enumerate(zip(answers[0], (30.0, 40.0), strict=True))
    ]
    assert compare(*paths).frames[NAME].rows.n.max() == 40


@pytest.fixture(scope="module")
def different(tmp_path_factory):
    """Return a folder of five stores that have little in common."""
    folder, right = tmp_path_factory.mktemp("different"), np.ones((2, 2, 20))
    for name, widths in (("a", [10.0, 30.0]), ("b", [50.0, 60.0]), ("c", [30.0, 50.0])):
        store(folder / f"{name}.zarr", right * (name != "c"), pulse_width=widths)
    store(folder / "d.zarr", right, ASPECTS + 0.5, pulse_width=[10.0, 30.0])
    heights = xr.Dataset({"height": ("size", [1.0])}, {"size": [1]})
    stored(folder / "tree.zarr", tables__tree=heights)
    return folder


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("a.zarr", "a.zarr"), "a.zarr' is given twice; give two different stores"),
        (("a.zarr", "none.zarr"), "which does not exist"),
        (("a.zarr", "tree.zarr"), "in common, but a.zarr has scores and tree.zarr has tree"),
        (
            ("a.zarr", "b.zarr"),
            "a value of pulse width in common, but a.zarr has 10, 30 and b.zarr has",
        ),
        (("a.zarr", "d.zarr"), "a table with answers to the same views in common, but a.zarr has"),
        (("a.zarr", "c.zarr", "--table", "x"), "table is 'x', but must be one of differences"),
        (("a.zarr", "--pictures", "c.zarr"), "--pictures draws one store"),
    ],
)
def test_invalid_arguments_give_a_one_line_error(arguments, said, different, monkeypatch, capsys):
    monkeypatch.chdir(different)
    assert reported(monkeypatch, *arguments) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_same_named_stores_are_distinguished_by_folder(answers, tmp_path):
    paths = []
    for folder, right in zip("xy", answers[0], strict=True):
        (tmp_path / folder).mkdir()
        paths.append(store(tmp_path / folder / "s.zarr", right))
    compared = compare(*paths)
    assert (
        compared.names == ("x/s.zarr", "y/s.zarr") and "x/s.zarr" in change_sentences(compared)[0]
    )
    assert compared.output_path == tmp_path / "y" / "y-s-less-x-s.zarr"
