"""The smoke sweep's store has units, provenance, plausible profiles and unchanged answers."""

import re

import numpy as np
import pytest
import xarray as xr
from commands import groups_of

from ncti.features import profile_vector
from ncti.ladar import noise_floor
from sweeps.engine.declare.storable import decode_attrs
from sweeps.report.page.provenance import iter_settings
from sweeps.report.page.provenance import swept_settings as page_swept
from sweeps.report.stores import attributes as attributes_of
from sweeps.report.stores import open_store

ASPECTS = [0, 15, 30, 45, 60, 75, 90]
VIEW = ("ship", "aspect")
VIEWS = 2 * len(ASPECTS)


@pytest.fixture(scope="module")
def groups(smoke_store):
    return groups_of(smoke_store)


def test_every_variable_has_units_and_a_name(groups):
    checked = 0
    for dataset in groups.values():
        for name, variable in dataset.variables.items():
            assert variable.attrs["long_name"], name
            if variable.dtype.kind not in "OTU":  # words have no unit
                assert variable.attrs["units"], name
                checked += 1
    assert checked > 150


def test_root_attributes_record_provenance(smoke_store):
    attributes = decode_attrs(xr.open_datatree(smoke_store, engine="zarr").attrs)
    assert attributes["seed"] == 0
    assert attributes["configuration"]["grid"]["aspect"] == ASPECTS
    assert attributes["configuration"]["render"]["engine"] in ("osmesa", "egl", "embree")
    assert set(attributes["mesh_digests"]) == {"duncan", "spruance"}
    assert attributes["versions"]["numpy"] == np.__version__
    text = str(attributes)
    assert str(smoke_store.parent) not in text
    assert not re.search(r"/home/|/root/|/tmp/", text)


def test_only_axes_that_a_stage_reads_are_swept(smoke_store):
    """`dataset.aspect` is one value of two numbers, of a sensor that this sweep lacks."""
    attributes = decode_attrs(xr.open_datatree(smoke_store, engine="zarr").attrs)
    assert attributes["configuration"]["dataset"]["aspect"] == [0, 360]
    grid = {f"grid.{name}" for name in ("ship", "aspect", "pulse_width", "frame_count")}
    assert grid <= set(attributes["axes"])
    assert not [key for key in attributes["axes"] if key.startswith(("dataset.", "classifier."))]
    swept = ["ship", "aspect", "pulse_width", "frame_count", "vigilance", "range"]
    assert attributes["swept"] == swept
    assert "dataset.aspect" not in dict(swept_on_page(smoke_store))


def swept_on_page(path):
    return page_swept(
        open_store(path), iter_settings(attributes_of(open_store(path))["configuration"])
    )


def test_profiles_are_physically_plausible(groups):
    profiles = groups["range_profile"]
    floor = noise_floor() * float(profiles.target_free_ifovs)
    # The ends of the window hold noise alone: the floor of the target-free IFOVs, and of the
    # few (at most 60) IFOVs on the ship.
    edge = profiles.expected.isel(down_range=0)
    assert ((edge >= floor) & (edge <= floor + 60 * noise_floor())).all()
    # From the bow the return is as long as the ship, 135.6 and 171.7 m, less the length behind
    # houses, plus the tails of the pulse; from the beam it is a house and its masts deep.
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
    overall = tables.accuracy.sel(aspect_bin="overall").drop_vars("aspect_bin")
    xr.testing.assert_allclose(overall, answers.correct.mean(VIEW), atol=1e-12)
    assert ((tables.ci_low <= tables.accuracy) & (tables.accuracy <= tables.ci_high)).all()
    assert (tables.n.sel(aspect_bin="overall") == VIEWS).all()
    assert (tables.settled == 1).all()


# Numbers of views named right, of 14, by pulse width (10, 30, 50 ns), then frames (4, 16); `acn`
# has an axis of vigilance (0.9, 0.95), too.
RIGHT = {
    "acn": [[[11, 12], [11, 14]], [[9, 10], [11, 13]], [[6, 10], [8, 12]]],
    "mnn": [[8, 10], [6, 8], [6, 10]],
    "correlation": [[11, 14], [11, 13], [10, 12]],
    "likelihood": [[13, 14], [13, 13], [10, 13]],
}


def right(tables, answers, **labels):
    return np.rint(answers * tables.accuracy.sel(aspect_bin="overall", **labels).squeeze())


@pytest.mark.parametrize("name", RIGHT)
def test_classifier_scores_are_pinned(name, groups):
    counts = right(groups[f"tables/{name}"], VIEWS)
    np.testing.assert_array_equal(counts, RIGHT[name])


# The duncan at 30 deg, 30 ns, 100 km, in four bins: noiseless, and of 16 frames.
BINS = [20, 100, 125, 150]
EXPECTED = [3983.460, 4000.045, 3991.274, 3990.080]
AVERAGED = [3984.955, 3999.652, 3983.695, 3996.573]
NEAR = 0.05  # machines, and engines that draw, differ by less; one frame's noise is 63


def profile(dataset, name):
    labels = {"ship": "duncan", "aspect": 30, "pulse_width": 30, "range": 100, "frame_count": 16}
    labels = {key: value for key, value in labels.items() if key in dataset[name].dims}
    return dataset[name].sel(labels).values.squeeze()[BINS]


def is_pinned(dataset):
    return {
        name: bool(np.abs(profile(dataset, name) - values).max() < NEAR)
        for name, values in (("expected", EXPECTED), ("averaged", AVERAGED))
    }


def test_profiles_are_pinned(groups):
    assert all(is_pinned(groups["range_profile"]).values())
