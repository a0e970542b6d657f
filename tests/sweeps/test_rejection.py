"""Ships that nobody taught: what is learned, what is rejected, and what the tables say of it."""

import io
import re

import numpy as np
import pytest
import xarray as xr
from rich.console import Console
from sweeping import command

from ncti.evaluate import replicated_accuracy, wilson_interval
from sweeps.classifier_schema import ClassifierConfig
from sweeps.errors import ConfigurationError
from sweeps.rejection import LEAST, tabulate_rejection
from sweeps.report.rejection import curve_rows, print_rejection, rejection_rows

SHIPS, ASPECTS = ("a", "b", "c"), (0.0, 1.5, 3.0)


def test_everything_is_learned_unless_told_otherwise():
    assert ClassifierConfig().learned(SHIPS, ASPECTS).all()


def test_unknown_ships_and_aspects_between_are_not_learned():
    config = ClassifierConfig(unknown="b", training_aspect={"start": 0, "stop": 3, "step": 3})
    np.testing.assert_array_equal(config.learned(SHIPS, ASPECTS), [[1, 0, 1], [0, 0, 0], [1, 0, 1]])


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            {"unknown": "d"},
            r"^classifier.unknown has 'd', .* one of a, b, c, the values of grid.ship$",
        ),
        ({"unknown": ["a", "b", "c"]}, r"^classifier.unknown has every ship"),
        ({"unknown": ["a", "a"]}, r"^classifier.unknown has 'a' more than once"),
        ({"unknown": 3}, r"^classifier.unknown"),
        ({"training_aspect": 2}, r"^classifier.training_aspect has 2, .* one of grid.aspect$"),
        ({"training_aspect": []}, r"^classifier.training_aspect is empty"),
        ({"training_aspect": float("nan")}, r"^classifier.training_aspect has nan"),
    ],
)
def test_what_cannot_be_meant_is_refused(keys, said):
    with pytest.raises(ConfigurationError, match=said):
        ClassifierConfig(**keys).learned(SHIPS, ASPECTS)


def test_fractions_are_counted_by_hand():
    """Two known ships at two learned aspects and one between, one unknown ship, two draws."""
    learned = np.array([[1, 0, 1], [1, 0, 1], [0, 0, 0]], bool)
    similarity = np.array(
        [
            [[0.9, 0.8, 0.7], [0.6, 0.5, 0.4], [0.65, 0.55, 0.3]],
            [[0.9, 0.2, 0.7], [0.6, 0.5, 0.9], [0.95, 0.1, 0.3]],
        ]
    )
    correct = np.array(
        [
            [[1, 1, 0], [1, 0, 1], [0, 0, 0]],
            [[1, 1, 1], [0, 0, 1], [0, 0, 0]],
        ]
    )
    correct[:, 1, 2] = -1  # a view that failed
    dims = ("replicate", "ship", "aspect")
    classified = xr.Dataset({"similarity": (dims, similarity), "correct": (dims, correct)})
    table = tabulate_rejection(classified, learned, (0.0, 0.6, 1.0))
    at = table.sel(aspects="learned")
    # Learned aspects of known ships: six answers, as one view failed; four of unknown ones.
    assert at.n_known == 6
    assert at.n_unknown == 4
    np.testing.assert_allclose(at.correct_known, [4 / 6, 4 / 6, 0])
    np.testing.assert_allclose(at.rejected_known, [0, 0, 1])
    np.testing.assert_allclose(at.rejected_unknown, [0, 2 / 4, 1])
    at = table.sel(aspects="between")
    assert (at.n_known, at.n_unknown) == (4, 2)
    np.testing.assert_allclose(at.correct_known, [2 / 4, 1 / 4, 0])
    np.testing.assert_allclose(at.rejected_known, [0, 3 / 4, 1])
    np.testing.assert_allclose(at.rejected_unknown, [0, 1, 1])


def test_the_characteristic_is_counted_by_hand():
    """Eight answers to known ships, eight to unknown ones, ties between and among them."""
    learned = np.array([[True] * 4] * 2 + [[False] * 4] * 2)
    similarity = np.array(
        [
            *([0.9, 0.8, 0.7, 0.4], [0.95, 0.6, 0.6, 0.2]),
            *([0.1, 0.3, 0.5, 0.6], [0.6, 0.7, 0.8, 0.85]),
        ]
    )
    correct = np.array([[1, 1, 0, 1], [1, 1, 1, 1], *[[0] * 4] * 2])
    dims = ("ship", "aspect")
    classified = xr.Dataset({"similarity": (dims, similarity), "correct": (dims, correct)})
    table = tabulate_rejection(classified, learned, (0.5,)).sel(aspects="learned")
    # Sorted unknown: .1 .3 .5 .6 .6 .7 .8 .85; of eight 0, 4, 7 (of 6.4), 8 (of 7.2 and 7.6).
    np.testing.assert_array_equal(table.least_rejected, [0, 0.5, 0.8, 0.9, 0.95])
    np.testing.assert_allclose(table.rejected_up_to, [np.nan, 0.6, 0.8, 0.85, 0.85])
    # Right ones above: all 7; .9 .8 .95; .9 .95; as many.
    np.testing.assert_allclose(table.correct_where_rejected, np.array([7, 3, 2, 2, 2]) / 8)
    low, high = wilson_interval([7, 3, 2, 2, 2], 8)
    np.testing.assert_allclose(table.correct_where_rejected_ci_low, low)
    np.testing.assert_allclose(table.correct_where_rejected_ci_high, high)
    pairs = sum(
        (known > unknown) + 0.5 * (known == unknown)
        for known in similarity[:2][correct[:2] == 1]
        for unknown in similarity[2:].ravel()
    )
    assert table.area == pytest.approx(pairs / 64)
    nothing = tabulate_rejection(classified, learned, (0.5,)).sel(aspects="between")
    assert np.isnan(nothing.area)
    assert np.isnan(nothing.correct_where_rejected).all()


@pytest.mark.parametrize("vigilances", [(0.0,), (0.9, 0.95), tuple(np.arange(0, 1.01, 0.01))])
def test_the_characteristic_does_not_hang_on_the_list_of_vigilances(vigilances):
    """And is that of every possible vigilance, tried one after the other."""
    answers = answers_of("replicate", seed=3).assign_coords(frame_count=16)
    table = tabulate_rejection(answers, LEARNED, vigilances).sel(aspects="learned")
    similarity, right = answers.similarity.values, answers.correct.values[:, :3] == 1
    known, unknown = similarity[:, :3], similarity[:, 3:]
    through, named = [1.0], [right.mean()]
    for threshold in np.sort(similarity.ravel()):
        through.append((unknown > threshold).mean())
        named.append((right & (known > threshold)).mean())
    assert table.area == pytest.approx(-np.trapezoid(named, through), rel=1e-12)
    for least, found in zip(LEAST, table.correct_where_rejected.values, strict=True):
        best = max(n for t, n in zip(through, named, strict=True) if 1 - t >= least - 1e-12)
        assert found == pytest.approx(best, rel=1e-12)
    rows = [
        row
        for row in curve_rows({"acn": tabulate_rejection(answers, LEARNED, vigilances)})
        if row["aspects"] == "learned"
    ]
    assert [row["least_percent_rejected"] for row in rows] == [0, 50, 80, 90, 95]
    for row, figure in zip(rows, table.correct_where_rejected.values, strict=True):
        assert row["percent_correct"] == pytest.approx(100 * figure, abs=0.0501)
        assert row["percent_area"] == pytest.approx(100 * float(table.area), abs=0.0501)


FIGURES = ("rejected_unknown", "rejected_known", "correct_known")
LEARNED = np.array([[True] * 20] * 3 + [[False] * 20] * 2)


def answers_of(*draws, seed=0):
    """Answers by chance to five ships at 20 aspects, the last two ships unknown."""
    rng = np.random.default_rng(seed)
    dims = (*draws, "ship", "aspect")
    shape = (*(3 for _ in draws), 5, 20)
    right = rng.integers(0, 2, shape) * LEARNED.any(axis=1)[:, None]
    return xr.Dataset({"similarity": (dims, rng.random(shape)), "correct": (dims, right)})


def assert_wilson(table, views):
    """Each interval is that of its fraction of so many answers."""
    for name in FIGURES:
        n = views["unknown" if name.endswith("unknown") else "known"]
        low, high = wilson_interval(np.rint(table[name] * n), n)
        np.testing.assert_allclose(table[f"{name}_ci_low"], low, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(table[f"{name}_ci_high"], high, rtol=1e-12)


def test_intervals_of_one_draw_are_wilson_s():
    table = tabulate_rejection(answers_of(), LEARNED, (0.2, 0.5, 0.9)).sel(aspects="learned")
    assert (table.n_known, table.n_unknown) == (60, 40)
    assert_wilson(table, {"known": 60, "unknown": 40})


def test_replicates_count_as_they_differ():
    """Equal ones as one; others by the design effect, between one and all of them."""
    vigilances = (0.2, 0.5, 0.9)
    alone = answers_of()
    same = xr.concat([alone] * 3, "replicate")
    table = tabulate_rejection(same, LEARNED, vigilances).sel(aspects="learned")
    assert (table.n_known, table.n_unknown) == (180, 120)
    assert_wilson(table, {"known": 60, "unknown": 40})
    several = answers_of("replicate")
    table = tabulate_rejection(several, LEARNED, vigilances).sel(aspects="learned")
    for name in FIGURES:
        views = 40 if name.endswith("unknown") else 60
        width = table[f"{name}_ci_high"] - table[f"{name}_ci_low"]
        widths = [
            np.subtract(*wilson_interval(table[name] * n, n)[::-1]) for n in (3 * views, views)
        ]
        assert (width >= widths[0] - 1e-12).all()
        assert (width < widths[1]).all()
    # Those of some accuracy are the intervals of its own table, whatever the vigilance.
    named = several.isel(ship=slice(3))
    whole = replicated_accuracy(named.correct.values == 1, np.arange(20))
    table = tabulate_rejection(several, LEARNED, (0.0,)).sel(aspects="learned", test_vigilance=0)
    np.testing.assert_allclose(table.correct_known_ci_low, whole.ci_low[-1])
    np.testing.assert_allclose(table.correct_known_ci_high, whole.ci_high[-1])


def test_phases_and_orders_are_no_more_views():
    """Nor is a training that failed one."""
    answers = answers_of("phase", "order")
    answers.correct[0, 1] = -1
    answers.similarity[0, 1] = np.nan
    table = tabulate_rejection(answers, LEARNED, (0.2, 0.5)).sel(aspects="learned")
    assert (table.n_known, table.n_unknown) == (8 * 60, 8 * 40)
    for name in FIGURES:
        views = 40 if name.endswith("unknown") else 60
        low, high = wilson_interval(table[name] * views, views)
        np.testing.assert_allclose(table[f"{name}_ci_low"], low, rtol=1e-12)
        np.testing.assert_allclose(table[f"{name}_ci_high"], high, rtol=1e-12)


def test_the_report_has_intervals_and_counts():
    table = tabulate_rejection(answers_of(), LEARNED, (0.0, 0.5, 0.95, 1.0))
    rows = rejection_rows({"correlation": table.assign_coords(frame_count=16)})
    assert len(rows) == 2 * 4
    for row in rows[:4]:
        at = table.sel(aspects="learned", test_vigilance=row["test_vigilance"])
        assert (row["n_known"], row["n_unknown"]) == (60, 40)
        for name in FIGURES:
            assert row[f"percent_{name}"] == pytest.approx(100 * float(at[name]), abs=0.05)
            for end in ("ci_low", "ci_high"):
                wanted = 100 * float(at[f"{name}_{end}"])
                assert row[f"{name}_{end}"] == pytest.approx(wanted, abs=0.05)
    # There are no aspects between learned ones, so nothing is known of them.
    for row in rows[4:]:
        ends = row["correct_known_ci_low"], row["correct_known_ci_high"]
        assert (row["percent_correct_known"], *ends) == (None, 0, 100)
    curve = curve_rows({"correlation": table.assign_coords(frame_count=16)})
    assert len(curve) == 2 * 5
    screen = io.StringIO()
    print_rejection(curve, Console(file=screen))
    printed = screen.getvalue()
    lines = [line for line in printed.splitlines() if "60 +" in line or " 40 " in line]
    assert len(lines) == 2
    shown = [re.findall(r"[\d-]+", line.partition("learned")[2] or line) for line in lines]
    of_learned = [row for row in curve if row["aspects"] == "learned"]
    figures = [f"{row['percent_correct']:.0f}" for row in of_learned]
    assert shown[0] == ["16", "60", *figures, f"{curve[0]['percent_area']:.0f}"]
    assert shown[1] == ["40", *(f"{row['ci_low']:.0f}-{row['ci_high']:.0f}" for row in of_learned)]
    assert not re.search(r"\b(nan|None)\b", printed)


def test_nobody_unknown_is_nothing_to_reject():
    dims = ("ship", "aspect")
    classified = xr.Dataset(
        {"similarity": (dims, np.ones((2, 3))), "correct": (dims, np.ones((2, 3), int))}
    )
    learned = np.array([[1, 0, 1], [1, 0, 1]], bool)
    table = tabulate_rejection(classified, learned, (0.5,))
    assert np.isnan(table.rejected_unknown).all()
    np.testing.assert_array_equal(table.correct_known, 1.0)


@pytest.fixture(scope="module")
def store(tmp_path_factory, cache):
    folder = tmp_path_factory.mktemp("unknown")
    (folder / "cache").mkdir()
    (cache / "meshes").mkdir(parents=True, exist_ok=True)
    (folder / "cache" / "meshes").symlink_to(cache / "meshes", target_is_directory=True)
    run = command(
        "sensor=both",
        "classifier.name=[acn,mnn,correlation,likelihood,fusion]",
        "grid.ship=[duncan,connole,spruance]",
        "grid.aspect=[0,15,30,45,60]",
        "grid.frame_count=[16]",
        "grid.replicate=2",
        "classifier.unknown=connole",
        "classifier.training_aspect=[0,30,60]",
        "classifier.label_rule=[majority,first]",
        "classifier.score_rule=[ship,category]",
        "infrared.phases=2",
        "infrared.orders=2",
        "render.pixel=0.5",
        "render.engine=embree",
        "store=s.zarr",
        folder=folder,
        cache=folder / "cache",
    )
    assert run.returncode == 0, run.stderr
    assert "Known ships named right" in run.stdout
    return folder / "s.zarr"


@pytest.mark.parametrize("name", ["acn", "mnn", "correlation", "likelihood", "fusion"])
def test_no_classifier_names_a_ship_that_nobody_taught(store, name):
    answers = xr.open_zarr(store, group=f"classification/{name}").load()
    assert set(np.unique(answers.predicted)) <= {0, 2}
    tables = xr.open_zarr(store, group=f"tables/{name}").load()
    draws, n = 2, tables.n.sel(aspect_bin="overall")
    if name == "acn":
        n = n.sel(score_rule="ship")
    assert (n == draws * 2 * 5).all()


def test_only_learned_views_are_trained_with(store):
    answers = xr.open_zarr(store, group="classification/acn").load()
    learned = answers.training_category.squeeze() >= 0
    expected = np.zeros((3, 5), bool)
    expected[np.ix_([0, 2], [0, 2, 4])] = True
    np.testing.assert_array_equal(learned.transpose("ship", "aspect"), expected)


def test_similarity_is_told_for_every_test(store):
    for name in ("acn", "acn_infrared", "correlation"):
        answers = xr.open_zarr(store, group=f"classification/{name}").load()
        assert np.isfinite(answers.similarity).all()
        table = xr.open_zarr(store, group=f"tables/rejection_{name}").load()
        assert set(table.aspects.values) == {"learned", "between"}
        # The higher the vigilance, the more is rejected and the less is right.
        for figure, sign in (("rejected_unknown", 1), ("rejected_known", 1), ("correct_known", -1)):
            steps = sign * table[figure].diff("test_vigilance")
            if "score_rule" in steps.dims:  # between learned aspects no category is right
                assert steps.sel(score_rule="category", aspects="between").isnull().all()
                steps = steps.sel(score_rule="ship")
            assert (steps >= 0).all(), figure


def test_rules_for_names_and_scores_are_axes(store):
    answers = xr.open_zarr(store, group="classification/acn").load()
    assert answers.correct.sizes["label_rule"] == answers.correct.sizes["score_rule"] == 2
    # Right by category is to fall where the same view fell in training.
    same = answers.category == answers.training_category
    found = answers.correct.sel(score_rule="category", label_rule="majority")
    found = found.transpose(*same.dims)
    np.testing.assert_array_equal(found == 1, same & (answers.category >= 0))
    # A view that was not learned has none, so that there is nothing to be right.
    asked = xr.ones_like(found) * (answers.training_category.squeeze() >= 0)
    np.testing.assert_array_equal(found >= 0, asked)
    state = xr.open_zarr(store, group="status").load().cell.transpose(*answers.correct.dims)
    np.testing.assert_array_equal(state == 1, answers.correct >= 0)
    np.testing.assert_array_equal(state == -1, answers.correct < 0)  # missing, not failed
    table = xr.open_zarr(store, group="tables/acn").load().sel(aspect_bin="overall")
    assert (table.n.sel(score_rule="category") == 2 * 2 * 3).all()
    assert (table.n.sel(score_rule="ship") == 2 * 2 * 5).all()
    table = xr.open_zarr(store, group="tables/rejection_acn").load().sel(score_rule="category")
    assert (table.n_known.sel(aspects="between") == 0).all()
    assert (table.n_unknown > 0).all()
    named = answers.predicted.sel(label_rule="first")
    ship = xr.DataArray(np.arange(3), dims="ship")
    found = answers.correct.sel(score_rule="ship", label_rule="first")
    np.testing.assert_array_equal(found.transpose(*named.dims) == 1, named == ship)
