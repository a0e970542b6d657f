"""A scan as it is recorded: trailing detectors, what averaging gains, jitter, and its metadata."""

import dataclasses
import math

import numpy as np
import pytest
import xarray as xr
from flown import CLEAN, flight, pole_on_box, wall

from ncti.infrared import band_contrast
from ncti.irar import Flight, fly, time_delay_integrate
from ncti.irar.scan import wander
from ncti.irar.scene import ScanPlan, plan_scan, scan_scene

TOLERANCE = 0.05


@pytest.fixture(scope="module")
def ship():
    return pole_on_box(60, 9, 5, 20)


@pytest.fixture(scope="module")
def flown(ship):
    return fly(ship, flight(175.0, samples=120, line_rate=60))


def snr(image):
    return image.mean() / image.std()


def framed(image, frames):
    """Means of so many lines after each other."""
    return image.reshape(-1, frames, image.shape[-1]).mean(axis=1)


def test_detectors_trail_each_other_over_the_ship(flown):
    """Detector k sees at sample j the column j - k, before the first sample as well."""
    scan = flown.noiseless()
    plan = flown.plan
    assert scan.infrared.shape == (12, plan.lines, 120)
    seen = scan_scene(pole_on_box(60, 9, 5, 20), plan, leading=11).coverage()
    warmth = band_contrast(plan.flight.slant_range)
    expected = seen * warmth
    for k in range(12):
        columns = np.arange(120) - k + 11
        np.testing.assert_allclose(scan.infrared[k], expected[:, columns], rtol=1e-6)
    np.testing.assert_array_equal(scan.infrared[5, :, 5:], scan.infrared[0, :, :-5])
    assert scan.infrared[0].max() == pytest.approx(warmth, rel=1e-6)


def test_active_and_passive_images_show_the_same_place(flown):
    scan = flown.noiseless()
    np.testing.assert_array_equal(scan.intensity > 0, scan.infrared[0] > 0)
    np.testing.assert_array_equal(scan.intensity > 0, ~np.isnan(scan.range))
    integrated = time_delay_integrate(scan.infrared)
    np.testing.assert_allclose(integrated, scan.infrared[0], rtol=1e-5)


def test_twelve_detectors_gain_the_root_of_twelve():
    """Signal-to-noise ratio over 5,340 pixels of a wall: 5 % is 5 standard errors.

    The relative standard error of a standard deviation of Gaussian noise is 1 / sqrt(2 n).
    """
    scan = wall(60, 100).record(np.random.default_rng(12))
    image = time_delay_integrate(scan.infrared)[:, : 100 - 11]
    assert image.size >= 4000
    assert snr(image) / snr(scan.infrared) == pytest.approx(math.sqrt(12), rel=TOLERANCE)


@pytest.mark.parametrize("frames", [8, 10, 12])
def test_averaged_lines_gain_the_root_of_their_number(frames):
    """Over 3,000 pixels of a wall at a high carrier-to-noise ratio: 5 % is 3.3 standard errors."""
    scan = wall(50 * frames, 60, cnr=CLEAN).record(np.random.default_rng(frames))
    image = framed(scan.intensity.astype(float), frames)
    assert image.size >= 2000
    assert snr(scan.intensity) == pytest.approx(1, rel=TOLERANCE)
    assert snr(image) / snr(scan.intensity) == pytest.approx(math.sqrt(frames), rel=TOLERANCE)


def test_lines_of_a_slow_flight_gain_nothing():
    """Looks of one pixel share their speckle: 4,000 pixels with the ratio of single looks, 1.

    Sets of 10 lines are correlated too, mu^20 = 0.96 in power, so that it is 400 columns that
    count: their ratio is known to sqrt(2 / 400).
    """
    slow = {"aircraft_speed": 0.9, "ship_speed": 0.0}
    scan = wall(100, 400, cnr=CLEAN, **slow).record(np.random.default_rng(3))
    image = framed(scan.intensity.astype(float), 10)
    assert snr(image) / snr(scan.intensity) == pytest.approx(1, abs=0.05)
    assert snr(image[0]) == pytest.approx(1, abs=4 * math.sqrt(2 / 400))


def test_lines_of_a_slow_flight_look_alike_and_those_of_the_study_do_not():
    """Correlation of the intensity from line to line is mu^2."""
    for changes, expected in (({"aircraft_speed": 0.9, "ship_speed": 0.0}, 0.998), ({}, 0.0)):
        scan = wall(60, 100, cnr=CLEAN, **changes).record(np.random.default_rng(3))
        found = np.corrcoef(scan.intensity[1:].ravel(), scan.intensity[:-1].ravel())[0, 1]
        assert found == pytest.approx(expected, abs=4 / math.sqrt(5900))


def test_the_same_generator_gives_the_same_scan(flown):
    first, again, other = (flown.record(np.random.default_rng(n)) for n in (1, 1, 2))
    for name in ("intensity", "range", "infrared"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
        assert not np.array_equal(getattr(first, name), getattr(other, name), equal_nan=True)


def test_a_scan_leaves_its_pass_alone(flown):
    before = flown.returns.power.copy(), flown.returns.distance.copy()
    quiet = flown.noiseless()
    flown.record(np.random.default_rng(1))
    np.testing.assert_array_equal((flown.returns.power, flown.returns.distance), before)
    np.testing.assert_array_equal(flown.noiseless().intensity, quiet.intensity)


def test_dropouts_have_neither_intensity_nor_range(flown):
    dim = dataclasses.replace(flown, plan=ScanPlan(
        dataclasses.replace(flown.plan.flight, threshold=6.0), flown.plan.first, flown.plan.lines
    ))  # fmt: skip
    scan = dim.record(np.random.default_rng(8))
    np.testing.assert_array_equal(scan.intensity == 0, np.isnan(scan.range))
    assert 0.1 < np.isnan(scan.range).mean() < 0.9
    assert scan.intensity[scan.intensity > 0].min() >= 6


def test_every_parameter_is_among_the_metadata(flown):
    """With its unit, and as a plain number that any format of file holds."""
    scan = flown.record(np.random.default_rng(1))
    data = scan.to_xarray()
    for field in dataclasses.fields(Flight):
        value = data.attrs[field.name]
        assert type(value) in (int, float), field.name
        given_ = getattr(scan.flight, field.name)
        assert value == (0.0 if field.name == "aircraft_track" else given_)
        assert data.attrs[f"{field.name}_units"]
    numbers = {"samples", "detectors", "cnr", "threshold"}
    without = {f.name for f in dataclasses.fields(Flight) if data.attrs[f"{f.name}_units"] == "1"}
    assert without == numbers
    assert data.attrs["aspect"] == pytest.approx(175)
    assert data.attrs["pulse_rate_units"] == "Hz" and data.attrs["ifov_units"] == "rad"
    assert data.attrs["clutter_units"] == "K" and data.attrs["band_stop_units"] == "m"
    rebuilt = Flight(**{f.name: data.attrs[f.name] for f in dataclasses.fields(Flight)})
    assert dataclasses.replace(rebuilt, aircraft_track=None) == scan.flight


def test_the_data_set_describes_itself(flown, tmp_path):
    scan = flown.record(np.random.default_rng(1))
    data = scan.to_xarray()
    assert set(data.data_vars) == {"intensity", "range", "infrared"}
    for variable in data.variables.values():
        assert variable.attrs["units"] and variable.attrs["long_name"]
    np.testing.assert_array_equal(data.intensity, scan.intensity)
    np.testing.assert_array_equal(data.range, scan.range)
    assert data.infrared.dims == ("detector", "line", "sample")
    # Line 0 begins at time 0; samples of a line follow at the pulse rate.
    assert data.time.sel(line=0, sample=0) == 0
    later = data.time.sel(line=1, sample=7) - data.time.sel(line=0, sample=0)
    assert later == pytest.approx(1 / 60 + 7 / 20_000)
    data.to_zarr(tmp_path / "scan.zarr", consolidated=False)
    xr.testing.assert_identical(
        xr.open_zarr(tmp_path / "scan.zarr", consolidated=False).load(), data
    )


@pytest.mark.parametrize("jitter_time", [0.004, 0.1, 10.0])
def test_attitude_wanders_as_a_markov_sequence(jitter_time):
    """20,000 lines: deviation and correlation of neighbours, with 4 of their standard errors."""
    flown_ = flight(jitter=2e-4, jitter_time=jitter_time)
    errors = wander(ScanPlan(flown_, 0, 20_000), np.random.default_rng(2))
    kept = math.exp(-1 / (119.0 * jitter_time))
    independent = 20_000 * (1 - kept) / (1 + kept)
    assert (errors**2).mean() == pytest.approx((2e-4) ** 2, rel=4 * math.sqrt(1 / independent))
    innovation = errors[1:] - kept * errors[:-1]
    expected = (2e-4) ** 2 * (1 - kept**2)
    assert (innovation**2).mean() == pytest.approx(expected, rel=4 * math.sqrt(1 / 20_000))
    level = 4 / math.sqrt(20_000)
    for a, b in ((innovation[1:], innovation[:-1]), (innovation[:, 0], innovation[:, 1])):
        assert abs((a * b).mean()) < level * expected


def test_jitter_moves_whole_lines(ship):
    """Of a pole its column moves by the error to the right, over the IFOV, line by line."""
    calm = fly(ship, flight(175.0))
    plan = plan_scan(ship, flight(175.0, jitter=3e-4, jitter_time=0.02))
    errors = wander(plan, np.random.default_rng(6))
    shaken = fly(ship, flight(175.0, jitter=3e-4, jitter_time=0.02), rng=np.random.default_rng(6))
    columns = np.arange(plan.flight.samples)

    def column(flown_, number):
        seen = flown_.returns.without_leading(11).coverage()[number - flown_.plan.first]
        return (seen * columns).sum() / seen.sum() if 0 < seen.sum() < 3 else math.nan

    numbers = np.arange(calm.plan.first, calm.plan.first + calm.plan.lines)
    moved = np.array([column(shaken, n) - column(calm, n) for n in numbers])
    wanted = -errors[numbers - plan.first, 0] / plan.flight.ifov
    known = ~np.isnan(moved)
    assert known.sum() > 100
    # A third of a pixel is resolved; an error upward moves what a leaning pole shows a little.
    assert np.abs(moved - wanted)[known].max() < 0.7
    assert np.corrcoef(moved[known], wanted[known])[0, 1] > 0.98


def test_randomness_must_be_given(ship, flown):
    with pytest.raises(ValueError, match=r"rng is None, but must be a numpy\.random\.Generator"):
        fly(ship, flight(175.0, jitter=1e-4))
    with pytest.raises(ValueError, match="rng is 3, but must be"):
        flown.record(3)
