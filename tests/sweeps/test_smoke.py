"""The smoke sweep: what its users find in the store and in the CSV files, number by number."""

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from commands import groups_of, opened, swept

from ncti.features import profile_vector
from ncti.ladar import noise_floor
from sweeps.engine.attributes import nested
from sweeps.experiment import EXPERIMENT
from sweeps.stages.views import Grid

ASPECTS = [0, 15, 30, 45, 60, 75, 90]
VIEW = ("ship", "aspect")
VIEWS = 2 * len(ASPECTS)


@pytest.fixture(scope="module")
def groups(smoke_store):
    return groups_of(smoke_store)


def test_store_opens_as_the_readme_says(smoke_store):
    profiles = xr.open_zarr(smoke_store, group="range_profile")
    cell = ("ship", "aspect", "pulse_width")
    assert profiles.averaged.dims == (*cell, "frame_count", "range", "down_range")
    assert profiles.expected.dims == (*cell, "range", "down_range")
    assert profiles.ship.values.tolist() == ["duncan", "spruance"]
    assert profiles.aspect.values.tolist() == ASPECTS
    assert profiles.down_range.values[[0, -1]].tolist() == [-124.5, 124.5]
    one = profiles.averaged.sel(ship="duncan", aspect=30, pulse_width=30, frame_count=16, range=100)
    assert one.shape == (250,)


def test_every_stage_and_table_has_its_group(groups):
    stored = {stage.group for stage in EXPERIMENT.stages if stage.group}
    tables = {table.group for table in EXPERIMENT.tables}
    # Nothing flies, is timed or is searched for here, and all ships are learned, so that there is
    # nothing to reject.
    absent = {"validation", "classification/measured", "status_measured", "run_time", "scan"}
    words = ("rejection", "measured", "run_time", "scan")
    absent |= {name for name in tables if any(word in name for word in words)}
    assert {name for name in groups if not name.startswith("status")} == (
        (stored | tables) - absent - {"status_fusion"}
    )


def test_every_variable_has_units_and_a_name(groups):
    checked = 0
    for dataset in groups.values():
        for name, variable in dataset.variables.items():
            assert variable.attrs["long_name"], name
            if variable.dtype.kind not in "OTU":  # words have no unit
                assert variable.attrs["units"], name
                checked += 1
    assert checked > 150


def test_root_says_what_made_it(smoke_store):
    attributes = nested(xr.open_datatree(smoke_store, engine="zarr").attrs)
    assert attributes["seed"] == 0
    assert attributes["configuration"]["grid"]["aspect"] == ASPECTS
    assert attributes["configuration"]["render"]["engine"] in ("osmesa", "egl", "embree")
    assert set(attributes["mesh_digests"]) == {"duncan", "spruance"}
    assert attributes["versions"]["numpy"] == np.__version__
    text = str(attributes)
    assert str(smoke_store.parent) not in text
    assert not re.search(r"/home/|/root/|/tmp/", text)


def test_every_cell_is_done(groups):
    states = {name: data for name, data in groups.items() if name.startswith("status")}
    assert len(states) == 7
    for dataset in states.values():
        for state in dataset.values():
            assert (state == 1).all()
    axes = ("pulse_width", "frame_count", "range", "vigilance")
    assert set(states["status"].cell.dims) == {*VIEW, *axes}


def test_profiles_are_what_a_physicist_expects(groups):
    profiles = groups["range_profile"]
    floor = noise_floor() * float(profiles.target_free_ifovs)
    # The ends of the window hold noise alone: the floor of the target-free IFOVs, and that of
    # the few (at most 60) IFOVs on the ship.
    edge = profiles.expected.isel(down_range=0)
    assert ((edge >= floor) & (edge <= floor + 60 * noise_floor())).all()
    # From the bow the return is as long as the ship, 135.6 and 171.7 m, less what the houses
    # hide and plus the tails of the pulse; from the beam it is a house and its masts deep.
    vectors = profile_vector(profiles.expected.sel(pulse_width=30, range=100))
    for row, length in zip(vectors, (135.6, 171.7), strict=True):
        bow_on, beam_on = (np.ptp(np.flatnonzero(row[i] > 0.01)) for i in (0, -1))
        assert 0.75 * length < bow_on < length + 10
        assert beam_on < 40
    # Averages scatter about the expected profile, less so the more frames they hold.
    scatter = (profiles.averaged - profiles.expected).std(("down_range", *VIEW))
    ratio = scatter.sel(frame_count=4) / scatter.sel(frame_count=16)
    assert (abs(ratio - 2) < 0.25).all()  # sqrt(16 / 4), from some 3,500 bins


def test_tables_agree_with_the_answers_in_the_store(groups):
    tables, answers = groups["tables/acn"], groups["classification/acn"]
    ship = xr.DataArray(np.arange(2), dims="ship")
    xr.testing.assert_equal(answers.correct == 1, answers.predicted == ship)
    overall = tables.accuracy.sel(aspect_bin="overall").drop_vars(["aspect_bin", "aspect_low"])
    xr.testing.assert_allclose(overall, answers.correct.mean(VIEW), atol=1e-12)
    assert ((tables.ci_low <= tables.accuracy) & (tables.accuracy <= tables.ci_high)).all()
    assert (tables.n.sel(aspect_bin="overall") == VIEWS).all()
    assert (tables.settled == 1).all()


def test_tables_are_written_as_csv(smoke_store):
    read = {
        path.stem: list(csv.DictReader(path.open()))
        for path in smoke_store.with_name("sweep-tables").glob("*.csv")
    }
    assert len(read) == 10
    assert {row["stage"] for row in read["stages"]} >= {"extent", "acn", "fusion"}
    assert len(read["categories"]) == 3 * 2
    # Two ships and seven aspects are not the source's views.
    for name in ("categories", "accuracy", "classifiers", "infrared_accuracy"):
        assert {row[key] for row in read[name] for key in row if key.startswith("source_")} == {""}
    # 4 bins (overall one of them) x (training + 2 frame counts) x 3 pulses x 2 vigilances
    assert len(read["accuracy"]) == 4 * 3 * 3 * 2
    for row in read["accuracy"]:
        assert 0 <= float(row["ci_low"]) <= float(row["percent_correct"])
        assert float(row["percent_correct"]) <= float(row["ci_high"]) <= 100


# Numbers of the whole chain, by pulse width (10, 30, 50 ns), then frames (4, 16): views named
# right, of 14; of `acn` by vigilance (0.9, 0.95), too.
RIGHT = {
    "acn": [[[12, 12], [14, 14]], [[7, 9], [10, 13]], [[8, 11], [9, 11]]],
    "mnn": [[8, 12], [6, 9], [5, 8]],
    "correlation": [[14, 14], [11, 13], [11, 14]],
    "likelihood": [[14, 14], [10, 13], [9, 13]],
}
CATEGORIES = [[10, 14], [7, 12], [7, 9]]
# Of silhouettes, by range (25, 50, 100 km) and frames, of 14 views in 2 phases and 2 orders;
# categories by phase and order.
SILHOUETTES = {"none": [[48, 48], [42, 48], [20, 30]], "shifted": [[48, 48], [48, 48], [30, 32]]}
SILHOUETTE_CATEGORIES = [[10, 10], [8, 8]]
# At 30 ns, 4 frames of either sensor and 2 draws, without super-resolution: of 28 answers.
FUSION = {"range": 20, "infrared": 10, "both": 19}


def right(tables, answers, **place):
    return np.rint(answers * tables.accuracy.sel(aspect_bin="overall", **place).squeeze())


@pytest.mark.parametrize("name", RIGHT)
def test_classifiers_answer_as_they_did(name, groups):
    found = right(groups[f"tables/{name}"], VIEWS)
    np.testing.assert_array_equal(found, RIGHT[name])


def test_silhouettes_and_fusion_are_named_as_they_were(groups):
    tables = groups["tables/acn_infrared"]
    for way, counts in SILHOUETTES.items():
        np.testing.assert_array_equal(right(tables, 4 * VIEWS, super_resolution=way), counts)
    np.testing.assert_array_equal(tables.category_count.squeeze(), SILHOUETTE_CATEGORIES)
    counts = groups["tables/acn"].category_count.squeeze()
    np.testing.assert_array_equal(counts, CATEGORIES)
    for channel, count in FUSION.items():
        place = {"pulse_width": 30, "frame_count": 4, "infrared_frame_count": 4}
        place |= {"super_resolution": "none", "channel": channel}
        assert right(groups["tables/fusion"], 2 * VIEWS, **place) == count


# The duncan at 30 deg, 30 ns, 100 km, in four bins: noiseless, and of 16 frames.
BINS = [20, 100, 125, 150]
EXPECTED = [3983.460, 4000.045, 3991.274, 3990.080]
AVERAGED = [3998.845, 3995.940, 3991.579, 3995.296]
NEAR = 0.05  # machines, and engines that draw, differ by less; one frame's noise is 63


def profile(dataset, name):
    at = {"ship": "duncan", "aspect": 30, "pulse_width": 30, "range": 100, "frame_count": 16}
    at = {key: value for key, value in at.items() if key in dataset[name].dims}
    return dataset[name].sel(at).values.squeeze()[BINS]


def is_pinned(dataset):
    return {
        name: bool(np.abs(profile(dataset, name) - values).max() < NEAR)
        for name, values in (("expected", EXPECTED), ("averaged", AVERAGED))
    }


def test_profiles_are_what_they_were(groups):
    assert all(is_pinned(groups["range_profile"]).values())


@pytest.mark.parametrize(
    ("changed", "lost"),
    [
        ("seed=0", set()),
        ("scene.depression=4", {"expected", "averaged"}),
        ("ladar.target_free_ifovs=3999", {"expected", "averaged"}),
        ("seed=1", {"averaged"}),
        ("aspect", {"averaged"}),
        ("pulse_width", {"averaged"}),
    ],
)
def test_a_change_would_be_seen(changed, lost, folder, results):
    """Of the view, of the noise floor, or of what a stream of noise is named by."""
    experiment, given = EXPERIMENT, [changed] if "=" in changed else []
    if not given:
        stages = tuple(
            replace(one, stream=tuple(key for key in one.stream if key.name != changed))
            if one.name == "averaged"
            else one
            for one in EXPERIMENT.stages
        )
        experiment = replace(EXPERIMENT, stages=stages)
    tiny = ("grid.ship=duncan", "grid.aspect=[30,60]", "grid.frame_count=16", *given)
    swept(folder / "s.zarr", results, *tiny, experiment=experiment)
    profiles = opened(folder / "s.zarr", "range_profile")
    assert {name for name, same in is_pinned(profiles).items() if not same} == lost


STREAMED = {
    "ship": "[duncan,texas]",
    "aspect": "[0,90]",
    "pulse_width": "[30,50]",
    "range": "[50,100]",
    "target_free_ifovs": "[1000,2000]",
    "replicate": "2",
    "ifov_phase": "2",
}


def test_noise_differs_along_every_axis(folder, results):
    """But for the numbers of frames, which are prefixes of one run."""
    keys = {"target_free_ifovs": "ladar.target_free_ifovs", "ifov_phase": "ladar.phases"}
    given = [f"{keys.get(name, f'grid.{name}')}={value}" for name, value in STREAMED.items()]
    swept(folder / "s.zarr", results, "render.pixel=0.5", "grid.frame_count=[4,8]", *given)
    profiles = opened(folder / "s.zarr", "range_profile")
    scale = profiles.averaged.std("down_range")
    noise = ((profiles.averaged - profiles.expected) / scale).transpose(..., "down_range")

    def alike(axis, of):
        one, other = (of.isel({axis: place}).values for place in (0, 1))
        assert not (one == other).all(axis=-1).any()
        return np.corrcoef(one.ravel(), other.ravel())[0, 1]

    # Of 8,000 bins, some 2,000 pulse lengths: a standard deviation of 0.02.
    for axis in STREAMED:
        # Expected profiles are those of the first phase: in others all noise shares the difference.
        of = noise if axis == "ifov_phase" else noise.sel(ifov_phase=0)
        assert abs(alike(axis, of.sel(frame_count=8))) < 0.1, axis
    assert alike("frame_count", noise.sel(ifov_phase=0)) == pytest.approx(np.sqrt(0.5), abs=0.05)
    assert {setting.name for setting in EXPERIMENT.by_name["averaged"].stream} == set(STREAMED)
    assert Grid.frame_count not in EXPERIMENT.by_name["averaged"].stream
