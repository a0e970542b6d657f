"""A tiny sweep of all classifiers of range profiles: its store, its tables, what runs again."""

import csv
import math
import re

import numpy as np
import pytest
import xarray as xr
from sweeping import command, contents
from test_configuration import composed
from test_sweep import fresh
from threadpoolctl import threadpool_limits

import ncti.ships
from ncti.evaluate import wilson_interval
from ncti.ladar import expected_profile, frame_moments, noise_floor, range_extent
from ncti.render import range_image
from sweeps import graph, stages
from sweeps.app import main, replace_axes
from sweeps.naming import Profiles, name_by_correlation, name_by_likelihood
from sweeps.prepare import prepare
from sweeps.report.classifiers import source_percent
from sweeps.report.command import main as report

SWEEP = [
    "grid.ship=[duncan,spruance]",
    "grid.aspect=[0,45,90]",
    "grid.pulse_width=[30,50]",
    "grid.frame_count=[2,4]",
    "grid.vigilance=[0.9,0.95]",
    "grid.replicate=2",
    "render.pixel=0.5",
    "render.samples=0",
    "render.engine=embree",
    "classifier=all",
    "classifier.training=[expected,noisy]",
    "classifier.left_out=[false,true]",
    "classifier.gain_sigma=[0,1]",
    "classifier.mnn.inputs=[raw,standardised]",
    "classifier.mnn.annealing=[true,false]",
    "classifier.mnn.epochs=40",
]
NAMES = ("acn", "mnn", "correlation", "likelihood")
OWN = {  # axes that each of them has several values on
    "acn": {"vigilance": [0.9, 0.95]},
    "mnn": {"inputs": ["raw", "standardised"], "annealing": [True, False]},
    "correlation": {"training": ["expected", "noisy"], "left_out": [False, True]},
    "likelihood": {"gain_sigma": [0, 1], "left_out": [False, True]},
}
SCALARS = {  # and axes of one value
    "acn": {"learning_rate"},
    "mnn": {"epochs", "grow_every", "mnn_learning_rate", "tolerance"},
    "correlation": set(),
    "likelihood": set(),
}
STATES = {name: "status" if name == "acn" else f"status_{name}" for name in NAMES}
BINS = ["0", "45", "90", "overall"]
SHAPE = {"replicate": 2, "frame_count": 2, "ship": 2, "aspect": 3}


def run(monkeypatch, folder, *given, cache, code=0):
    """The tiny sweep in this process, with other values of what is given."""
    keys = tuple(item.partition("=")[0] + "=" for item in given)
    tiny = [item for item in SWEEP if not item.startswith(keys)]
    monkeypatch.chdir(folder)
    arguments = [*tiny, *given, "cluster=inline", "store=s.zarr", f"cache={cache}"]
    monkeypatch.setattr("sys.argv", ["ncti-sweep", *arguments])
    # One thread, as a worker has: products then round alike.
    with threadpool_limits(1), pytest.raises(SystemExit) as exit_:
        main()
    assert exit_.value.code == code


@pytest.fixture(scope="module")
def swept(tmp_path_factory, cache):
    """The folder of the sweep, run on two workers with a stage cache of its own."""
    folder = tmp_path_factory.mktemp("classifiers")
    done = command(
        *SWEEP, "cluster.workers=2", "store=s.zarr", folder=folder, cache=fresh(folder, cache)
    )
    assert done.returncode == 0, done.stderr
    return folder


def group(folder, name):
    return xr.open_zarr(folder / "s.zarr", group=name).load()


def rows_of(folder, name="classifiers"):
    with (folder / "s-tables" / f"{name}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_one_worker_makes_the_same_store(swept, tmp_path, cache):
    one = command(
        *SWEEP, "cluster.workers=1", "store=s.zarr", folder=tmp_path, cache=fresh(tmp_path, cache)
    )
    assert one.returncode == 0, one.stderr
    assert contents(tmp_path / "s.zarr") == contents(swept / "s.zarr")
    assert contents(tmp_path / "s-tables") == contents(swept / "s-tables")


@pytest.mark.parametrize("name", NAMES)
def test_answers_have_their_axes(name, swept):
    answers = group(swept, f"classification/{name}")
    own = {key: len(values) for key, values in OWN[name].items()}
    cell = {"pulse_width": 2, "range": 1}
    assert dict(answers.correct.sizes) == cell | own | SHAPE
    assert answers.predicted.sizes == answers.correct.sizes
    for key, values in OWN[name].items():
        assert answers[key].values.tolist() == values
    for key in SCALARS[name] | {"target_free_ifovs"}:
        assert answers[key].ndim == 0
    others = set().union(*(SCALARS[other] | set(OWN[other]) for other in NAMES))
    assert not set(answers.coords) & (others - SCALARS[name] - set(OWN[name]))
    state = group(swept, STATES[name])
    assert np.all(state.cell == 1)
    assert state.cell.sizes == answers.correct.sizes
    ship = xr.DataArray(np.arange(2), dims="ship")
    right = answers.predicted == ship
    if name == "mnn":
        assert answers.hidden.sizes == answers.loss.sizes == cell | own
        xr.testing.assert_equal(answers.ship_correct == 1, right)
        # The aspects are one of each group.
        right &= answers.predicted_bin == xr.DataArray(np.arange(3), dims="aspect")
        assert np.all(answers.presentations == 40)
        assert np.all((answers.loss > 0) & (answers.loss < 4))
    xr.testing.assert_equal(answers.correct == 1, right)
    assert 0 < right.mean() < 1


def test_every_array_says_what_it_holds(swept):
    """And of what unit, but for words."""
    tree = xr.open_datatree(swept / "s.zarr", engine="zarr")
    held = {node.path.strip("/"): node.to_dataset() for node in tree.subtree if node.has_data}
    assert set(held) == {
        *("range_profile", *STATES.values()),
        *(f"{kind}/{name}" for kind in ("classification", "tables") for name in NAMES),
    }
    for dataset in held.values():
        for array in dataset.variables.values():
            assert array.attrs["long_name"]
            assert array.dtype.kind not in "iuf" or array.attrs["units"]
        for array in dataset.data_vars.values():
            assert array.attrs["units"] == "1"
    profiles = held["range_profile"]
    assert profiles.lag.attrs["units"] == profiles.down_range.attrs["units"] == "m"
    for name in NAMES:
        assert held[f"tables/{name}"].attrs["receiver"] == "full_profile"
        flags = held[STATES[name]].cell.attrs
        assert flags["flag_meanings"] == "missing failed done"
        assert list(flags["flag_values"]) == [-1, 0, 1]


@pytest.mark.parametrize("name", NAMES)
def test_tables_are_fractions_of_the_answers(name, swept):
    """Intervals are between those of as many answers as there are, and as many views."""
    tables = group(swept, f"tables/{name}")
    answers = group(swept, f"classification/{name}")
    assert tables.aspect_bin.values.tolist() == BINS
    assert tables.aspect_low.values[:3].tolist() == [0, 45, 90]
    kinds = {"": "correct", "training_": "training_correct", "ship_": "ship_correct"}
    for prefix, correct in kinds.items():
        assert (f"{prefix}accuracy" in tables) == (correct in answers)
        if correct not in answers:
            continue
        replicates = 2 if "replicate" in answers[correct].dims else 1
        over = [key for key in ("replicate", "ship") if key in answers[correct].dims]
        by_aspect = answers[correct].mean(over)
        accuracy, n = tables[f"{prefix}accuracy"], tables[f"{prefix}n"]
        low, high = tables[f"{prefix}ci_low"], tables[f"{prefix}ci_high"]
        for number, label in enumerate(BINS[:3]):
            ours = by_aspect.isel(aspect=number, drop=True)
            stored = accuracy.sel(aspect_bin=label)
            np.testing.assert_allclose(stored, ours.transpose(*stored.dims), atol=1e-12)
            assert np.all(n.sel(aspect_bin=label) == 2 * replicates)
        stored = accuracy.sel(aspect_bin="overall")
        ours = by_aspect.mean("aspect").transpose(*stored.dims)
        np.testing.assert_allclose(stored, ours, atol=1e-12)
        assert np.all(n.sel(aspect_bin="overall") == 6 * replicates)
        wide, narrow = (wilson_interval(accuracy * n / k, n / k) for k in (replicates, 1))
        for low_end, middle, high_end in (
            (wide[0], low, narrow[0]),
            (narrow[1], high, wide[1]),
        ):
            assert np.all(low_end <= middle + 1e-12)
            assert np.all(middle <= high_end + 1e-12)


def test_profiles_and_covariances_are_the_librarys(swept):
    """Of a view, from its image on; the covariance's band is the dense matrix's."""
    image = range_image(
        ncti.ships.load("spruance"), aspect=45, depression=3.84, pixel=0.5, engine="embree"
    )
    extent = range_extent(image, slant_range=100e3, ifov=150e-6, bin_width=1.0, window=250.0)
    profiles = group(swept, "range_profile").sel(ship="spruance", aspect=45, range=100)
    bins = profiles.sizes["down_range"]
    for pulse_width in (30, 50):
        found = profiles.sel(pulse_width=pulse_width)
        signal = {"pulse_width": pulse_width * 1e-9, "cnr": 10**3.2, "target_free_ifovs": 4000}
        mean, dense = frame_moments(extent, **signal)
        # Half a unit in the last place of float32.
        np.testing.assert_allclose(found.expected, mean, rtol=2**-24)
        np.testing.assert_allclose(found.expected, expected_profile(extent, **signal), rtol=2**-24)
        band = found.covariance.values
        assert found.lag.values.tolist() == list(range(len(band)))
        whole = np.zeros((bins, bins))
        for lag in range(bins):
            n = np.arange(bins - lag)
            if lag < len(band):
                whole[n, n + lag] = whole[n + lag, n] = band[lag, : bins - lag]
                assert not band[lag, bins - lag :].any()
        np.testing.assert_allclose(whole, dense, rtol=2**-24, atol=2**-149)
        assert dense[0, 1] > 0.5 * dense[0, 0]  # it is a band, not a diagonal


def test_floors_are_the_noise_of_all_ifovs(swept):
    """4,000 target-free ones and the ship's own, at the edge of the window."""
    profiles = group(swept, "range_profile").sel(range=100, ship=["duncan"], aspect=[90])
    image = range_image(
        ncti.ships.load("duncan"), aspect=90, depression=3.84, pixel=0.5, engine="embree"
    )
    on_target = len(range_extent(image, slant_range=100e3, ifov=150e-6, bin_width=1.0).fraction)
    assert on_target > 10
    assert noise_floor() == pytest.approx((math.pi**3 / 32) ** 0.25)
    for number in range(2):
        expected = profiles.expected.isel(pulse_width=number).values[0]
        there = np.ones((1, 1), dtype=bool)
        floor = Profiles(expected, expected[None, None], there, np.array([90.0]), (1,)).floor
        np.testing.assert_allclose(floor, (4000 + on_target) * noise_floor(), rtol=2**-23)


@pytest.mark.parametrize("number", [0, 1])
def test_a_cell_is_named_by_its_own_profiles(number, swept):
    """Those of its pulse width in the store, whose floor is in them."""
    config = prepare(composed(*replace_axes(SWEEP))).config
    held = group(swept, "range_profile").isel(pulse_width=number, range=0)
    views = {"view": ("ship", "aspect")}
    profiles = Profiles(
        expected=held.expected.stack(views).transpose("view", "down_range").values,
        averaged=held.averaged.stack(views)
        .transpose("replicate", "frame_count", "view", "down_range")
        .values,
        there=np.ones((2, 3), dtype=bool),
        aspects=held.aspect.values,
        frame_count=(2, 4),
    )
    covariance = held.covariance.stack(views).transpose("view", "lag", "down_range").values
    settings = {"classifier": config.classifier}
    with threadpool_limits(1):
        wanted = {
            "correlation": name_by_correlation(profiles, **settings),
            "likelihood": name_by_likelihood(profiles, covariance, **settings),
        }
    for name, arrays in wanted.items():
        answers = group(swept, f"classification/{name}").isel(pulse_width=number, range=0)
        for kind, values in arrays.items():
            stored = answers[kind].values
            np.testing.assert_allclose(stored, values.reshape(stored.shape), rtol=1e-5, atol=1e-9)


COLUMNS = [
    "classifier",
    "range_km",
    "pulse_width_ns",
    "target_free_ifovs",
    *("vigilance", "learning_rate", "label_rule", "score_rule"),
    *("training", "gain_sigma", "left_out"),
    *("epochs", "grow_every", "mnn_learning_rate", "tolerance", "inputs", "annealing"),
    "frame_count",
    "aspect_bin_deg",
    "percent_correct",
    "ci_low",
    "ci_high",
    "n",
    "source_percent",
    "points_below_bound",
]
KEYS = COLUMNS[: COLUMNS.index("percent_correct")]


def test_the_file_has_its_columns_and_a_row_a_cell(swept):
    every = rows_of(swept)
    assert list(every[0]) == COLUMNS
    # Of what the two networks were trained with: 2 pulse widths, 4 bins.
    taught = [row for row in every if not row["frame_count"]]
    assert len(taught) == 2 * 4 * (2 + 4)
    rows = [row for row in every if row["frame_count"]]
    # 2 pulse widths, 2 numbers of frames, 4 bins; settings of each, the network scored twice.
    counts = {"acn": 2, "mnn": 4, "mnn_ship": 4, "correlation": 4, "likelihood": 4}
    assert len(rows) == 2 * 2 * 4 * sum(counts.values())
    for name, count in counts.items():
        assert sum(row["classifier"] == name for row in rows) == 2 * 2 * 4 * count
    assert len({tuple(row[key] for key in KEYS) for row in rows}) == len(rows)
    # What is no setting of a classifier is empty in its rows.
    for row in rows:
        name = row["classifier"].removesuffix("_ship")
        filled = {key for key in COLUMNS[4:17] if row[key] != ""}
        rules = {"label_rule", "score_rule"} if name == "acn" else set()
        assert filled == SCALARS[name] | set(OWN[name]) | rules


def test_figures_in_the_file_are_those_of_the_store(swept):
    tables = {name: group(swept, f"tables/{name}") for name in NAMES}
    for row in rows_of(swept):
        name = row["classifier"].removesuffix("_ship")
        prefix = "ship_" if row["classifier"].endswith("_ship") else ""
        place = {
            "range": float(row["range_km"]),
            "pulse_width": float(row["pulse_width_ns"]),
            "aspect_bin": row["aspect_bin_deg"],
        }
        if row["frame_count"]:
            place["frame_count"] = int(row["frame_count"])
        else:
            prefix = "training_"
        for key, values in OWN[name].items():
            (place[key],) = (value for value in values if str_of(value) == row[key])
        cell = tables[name].sel(place)
        for column, variable in (
            ("percent_correct", "accuracy"),
            ("ci_low", "ci_low"),
            ("ci_high", "ci_high"),
        ):
            stored = 100 * cell[prefix + variable].item()
            assert float(row[column]) == pytest.approx(stored, abs=0.0501)
        assert int(row["n"]) == cell[prefix + "n"].item()
        assert int(row["target_free_ifovs"]) == 4000


def str_of(value):
    return str(value if isinstance(value, str | bool) else float(value))


def test_points_below_the_bound(swept):
    """Those of the best known gain with all templates, less one's own, of the same test."""
    every = rows_of(swept)
    assert {row["points_below_bound"] for row in every if not row["frame_count"]} == {""}
    # Ship and aspect group is another question than the ship alone.
    assert {row["points_below_bound"] for row in every if row["classifier"] == "mnn"} == {""}
    rows = [row for row in every if row["frame_count"] and row["classifier"] != "mnn"]
    same = ("range_km", "pulse_width_ns", "target_free_ifovs", "frame_count", "aspect_bin_deg")
    allowed = [
        row for row in rows if row["classifier"] == "likelihood" and row["left_out"] == "False"
    ]
    below = []
    for row in rows:
        bounds = [
            float(other["percent_correct"])
            for other in allowed
            if all(other[key] == row[key] for key in same)
        ]
        assert len(bounds) == 2
        wanted = max(bounds) - float(row["percent_correct"])
        assert float(row["points_below_bound"]) == pytest.approx(wanted, abs=1e-9)
        below.append(wanted)
    assert min(below) <= 0 < max(below)


def test_the_sources_figures_stand_where_it_has_some(swept):
    """30 ns, 4 frames, by aspect group; of the ACN at its vigilance, of the network as scored."""
    tables = {
        "4": {"0": "48", "45": "25", "90": "23", "overall": ""},
        "": {"0": "100", "45": "93", "90": "43", "overall": ""},  # of what they were trained with
    }
    found = 0
    for row in rows_of(swept):
        asked = row["classifier"] == "mnn" or (
            row["classifier"] == "acn" and row["vigilance"] == "0.95"
        )
        table = tables.get(row["frame_count"])
        there = asked and row["pulse_width_ns"] == "30.0" and table is not None
        wanted = table[row["aspect_bin_deg"]] if there else ""
        assert row["source_percent"] == wanted
        found += wanted != ""
    assert found == 2 * 3 * (1 + 4)


@pytest.mark.parametrize(
    ("change", "lowest", "receiver", "figure"),
    [
        ({}, 0, "full_profile", 63),
        ({}, 57, "full_profile", 20),
        ({}, 60, "full_profile", 25),
        ({}, 90, "full_profile", 25),
        ({}, 93, "full_profile", None),
        ({}, math.nan, "full_profile", None),
        ({}, 0, "peak_pulse", None),
        ({"range_km": 50}, 0, "full_profile", None),
        ({"pulse_width_ns": 10}, 0, "full_profile", None),
        ({"frame_count": 7}, 0, "full_profile", None),
    ],
)
def test_whose_figure_the_source_has(change, lowest, receiver, figure):
    axes = {"range_km": 100, "pulse_width_ns": 30, "frame_count": 8} | change
    assert source_percent("mnn", axes, lowest, receiver) == figure
    assert source_percent("acn", axes | {"vigilance": 0.95}, lowest, receiver) == figure
    for name, vigilance in (("acn", 0.9), ("correlation", None), ("likelihood", None)):
        assert source_percent(name, axes | {"vigilance": vigilance}, lowest, receiver) is None


def test_the_report_prints_all_side_by_side(swept, monkeypatch, capsys):
    before = contents(swept / "s-tables")
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr("sys.argv", ["ncti-report", str(swept / "s.zarr")])
    report()
    printed = capsys.readouterr().out
    assert contents(swept / "s-tables") == before
    assert not re.search(r"\b(nan|None|inf)\b", printed)
    for pulse_width in (30, 50):
        title = f"by classifier (100 km, 4000 target-free IFOVs, {pulse_width} ns)"
        assert title in printed
    for line in (
        "MNN, ship and aspect group, raw inputs, annealed",
        "MNN, ship alone, standardised inputs, not annealed",
        "correlation, learned from noisy profiles, true aspect left out",
        "maximum likelihood, gain known",
        "maximum likelihood, gain unknown by 100%, true aspect left out",
    ):
        # Pulse widths, numbers of frames; of a network's own answers also to its training.
        trained = "aspect group" in line
        assert printed.count(f"{line} ") == 2 * (2 + trained)


def never(*args, **kwargs):
    raise AssertionError("a finished stage was computed again")


STAGES = (
    *("range_image", "range_extent", "sample_frames", "expected_profile"),
    "banded_frame_moments",
)


def test_other_settings_of_classifiers_draw_nothing_again(swept, tmp_path, monkeypatch):
    for name in STAGES:
        monkeypatch.setattr(stages, name, never)
    given = (
        "classifier.gain_sigma=0.5",
        "classifier.nugget=0.01",
        "classifier.left_out=false",
        "classifier.training=noisy",
        "classifier.mnn.epochs=[3,5]",
        "classifier.mnn.inputs=floor_removed",
        "classifier.mnn.annealing=true",
        "grid.vigilance=0.8",
    )
    run(monkeypatch, tmp_path, *given, cache=swept / "cache")
    for name in NAMES:
        assert np.all(group(tmp_path, STATES[name]).cell == 1)
    answers = group(tmp_path, "classification/mnn")
    assert answers.presentations.isel(pulse_width=0, range=0).values.tolist() == [3, 5]
    for name, dims in (("correlation", {"training", "left_out"}), ("likelihood", {"gain_sigma"})):
        assert not dims & set(group(tmp_path, f"tables/{name}").dims)


def test_one_classifier_alone(swept, tmp_path, monkeypatch, capsys):
    """What it needs is measured, what others need is not; its answers are the same."""
    for name in STAGES:
        monkeypatch.setattr(stages, name, never)
    run(monkeypatch, tmp_path, "classifier=mnn", cache=swept / "cache")
    tree = xr.open_datatree(tmp_path / "s.zarr", engine="zarr")
    assert {node.path.strip("/") for node in tree.subtree if node.has_data} == {
        *("range_profile", "status", "status_mnn", "classification/mnn", "tables/mnn")
    }
    assert "covariance" not in tree["range_profile"]
    assert np.all(tree["status_mnn"].cell == 1)
    assert np.all(tree["status"].view == 1)
    assert "cell" not in tree["status"]
    assert set(contents(tmp_path / "s-tables")) == {"classifiers.csv"}
    rows = rows_of(tmp_path)
    assert {row["points_below_bound"] for row in rows} == {""}
    # Weights are drawn by cell, whoever else names ships; products of this process may
    # round otherwise, which 40 epochs do not make much of.
    ours, theirs = (group(folder, "classification/mnn") for folder in (tmp_path, swept))
    xr.testing.assert_allclose(ours.loss, theirs.loss, rtol=1e-4)
    assert "maximum likelihood" not in capsys.readouterr().out.partition("Below bound")[0]


IMAGER = (
    *("infrared.range=25", "infrared.phases=1", "infrared.orders=1"),
    *("infrared.super_resolution=none", "grid.vigilance=0.9"),
)


def test_likelihood_with_both_sensors(swept, tmp_path, monkeypatch, capsys):
    given = ("classifier=likelihood", "sensor=both", *IMAGER)
    run(monkeypatch, tmp_path, *given, cache=swept / "cache")
    ours, theirs = (group(folder, "classification/likelihood") for folder in (tmp_path, swept))
    # Of the same profiles and covariances; log-likelihoods of some 1e3 may round to 1e-12 of them.
    xr.testing.assert_allclose(ours.probability, theirs.probability, atol=1e-5)
    xr.testing.assert_equal(ours.predicted, theirs.predicted)
    files = {f"infrared_{name}.csv" for name in ("sensor", "detection", "super_resolution")}
    assert set(contents(tmp_path / "s-tables")) == {"classifiers.csv"} | files
    assert {row["classifier"] for row in rows_of(tmp_path)} == {"likelihood"}
    printed = capsys.readouterr().out
    for title in ("Percent correct by classifier", "Passive-infrared sensor", "Ships detected"):
        assert title in printed
    assert "silhouettes" not in printed


def test_an_imager_whose_silhouettes_nobody_names(swept, tmp_path, monkeypatch, capsys):
    given = ("classifier=mnn", "sensor=infrared", *IMAGER)
    run(monkeypatch, tmp_path, *given, cache=swept / "cache")
    files = {f"infrared_{name}.csv" for name in ("sensor", "detection", "super_resolution")}
    assert set(contents(tmp_path / "s-tables")) == files
    assert "Ships detected" in capsys.readouterr().out


def test_a_sweep_that_was_killed_goes_on(swept, tmp_path, monkeypatch):
    """Amid the classifiers: some are done, the others missing; then the store is the same."""

    class Killed(BaseException):
        pass

    def kill(*args, **kwargs):
        raise Killed

    monkeypatch.setattr(graph, "name_by_correlation", kill)
    with pytest.raises(Killed):
        run(monkeypatch, tmp_path, cache=swept / "cache")
    for name, state in {"acn": 1, "mnn": 1, "correlation": -1, "likelihood": -1}.items():
        assert np.all(group(tmp_path, STATES[name]).cell == state)
        predicted = group(tmp_path, f"classification/{name}").predicted
        assert np.all(predicted == -1) == (state == -1)
    assert not (tmp_path / "s.zarr" / "tables" / "mnn").exists()
    monkeypatch.undo()
    run(monkeypatch, tmp_path, cache=swept / "cache")
    assert contents(tmp_path / "s.zarr") == contents(swept / "s.zarr")
    assert contents(tmp_path / "s-tables") == contents(swept / "s-tables")


def test_a_classifier_that_fails_is_named_and_the_rest_is_done(
    swept, tmp_path, monkeypatch, capsys
):
    whole = graph.name_by_likelihood

    def broken(profiles, covariance, **settings):
        if covariance[0, 1, 0] == lower:
            raise ArithmeticError("a storm")
        return whole(profiles, covariance, **settings)

    # The covariance of neighbours tells the pulse widths apart.
    lower = group(swept, "range_profile").covariance.sel(pulse_width=30).values[0, 0, 0, 1, 0]
    monkeypatch.setattr(graph, "name_by_likelihood", broken)
    run(monkeypatch, tmp_path, cache=swept / "cache", code=1)
    told = capsys.readouterr()
    assert (
        "classification of likelihood pulse_width=30 range=100 (ArithmeticError: a storm)"
        in told.err
    )
    assert not re.search(r"\b(nan|None)\b", told.out)
    states = group(tmp_path, "status_likelihood").cell
    assert np.all(states.sel(pulse_width=30) == 0)
    assert np.all(states.sel(pulse_width=50) == 1)
    for name in NAMES[:3]:
        assert np.all(group(tmp_path, STATES[name]).cell == 1)
    tables = group(tmp_path, "tables/likelihood")
    assert np.all(tables.n.sel(pulse_width=30) == 0)
    assert np.isnan(tables.accuracy.sel(pulse_width=30)).all()
    for row in (row for row in rows_of(tmp_path) if row["frame_count"]):
        lost = row["pulse_width_ns"] == "30.0"
        assert (row["points_below_bound"] == "") == (lost or row["classifier"] == "mnn")
        assert (row["percent_correct"] == "") == (lost and row["classifier"] == "likelihood")
