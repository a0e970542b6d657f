"""`sweeps.sweep` returns a data set of the results of a function and its argument values."""

import re
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as of_numpy

import sweeps
from sweeps.engine.declare.errors import CallsFailedWarning, ConfigurationError, DeclarationError

FREQUENCY = np.array([1.0, 10.0, 100.0])
CALLS: list[object] = []


@pytest.fixture
def run(sweep):
    """Return a function that sweeps another in a new folder, with no calls recorded before."""

    def swept(function, values, **options):
        CALLS.clear()
        return sweep(function, values, **options)

    return swept


def spectrum(a):
    power = xr.DataArray(a / FREQUENCY, {"frequency": ("frequency", FREQUENCY, {"units": "Hz"})})
    return power.assign_attrs(units="W", long_name="power", sensor="A")


def variables(a):
    """Return a data set with a data array, a scalar, a text and a scalar coordinate."""
    peak = ((), 2.0 * a, {"units": "m"})
    return xr.Dataset({"power": spectrum(a), "peak": peak, "name": f"number {a}"}, {"a": a})


def mapping(a):
    return {"power": spectrum(a), "peak": 2 * a, "flat": np.full(2, a)}


def frame(a):
    return pd.DataFrame({"u": [a, 2 * a], "v": [0, 1]}, index=pd.Index(["x", "y"], name="row"))


def uneven(a):
    return np.arange(float(a))


def later(t, days):
    CALLS.append(t)
    return t + np.timedelta64(days, "D")


def labelled(a):
    """Return a data set with more labels for larger arguments."""
    return xr.Dataset(
        {"x": ("k", np.arange(a)), "t": ("name", list("abc"[:a]))},
        {"k": np.arange(5, 5 + a), "name": ["a", "bb", "ccc"][:a], "side": ("k", np.arange(a) > 0)},
    )


def plus(a, b=0, c=0):
    CALLS.append((a, b, c))
    return 100 * a + 10 * b + c


VALUES = {"a": [1, 2]}


def test_a_data_array_keeps_dimensions_coordinates_and_attributes(run):
    results = run(spectrum, VALUES)
    assert results.spectrum.dims == ("a", "frequency") and list(results) == ["spectrum"]
    np.testing.assert_array_equal(results.spectrum, np.outer([1, 2], 1 / FREQUENCY))
    assert results.spectrum.attrs == {"units": "W", "long_name": "power", "sensor": "A"}
    np.testing.assert_array_equal(results.frequency, FREQUENCY)
    assert results.frequency.attrs["units"] == "Hz" and "frequency" in results.indexes


def test_a_data_set_becomes_variables(run):
    results = run(variables, VALUES)
    assert set(results.data_vars) == {"power", "peak", "name"}
    assert set(results.coords) == {"a", "frequency"}
    assert results.peak.values.tolist() == [2, 4] and results.peak.attrs["units"] == "m"
    assert results.name.values.tolist() == ["number 1", "number 2"]
    assert results.power.sel(a=2, frequency=10).item() == 0.2
    xr.testing.assert_identical(results, run(variables, {"a": [1, 2, 3]}).sel(a=[1, 2]))


def test_a_mapping_becomes_variables(run):
    results = run(mapping, VALUES, dims={"flat": "side"}, attrs={"peak": {"units": "m"}})
    assert set(results.data_vars) == {"power", "peak", "flat"}
    assert results.flat.dims == ("a", "side") and results.flat.values.tolist() == [[1, 1], [2, 2]]
    assert results.peak.attrs["units"] == "m" and results.power.attrs["units"] == "W"


def test_a_tuple_becomes_variables(run):
    def elements(a):
        return a, [a, a + 1], "odd" if a % 2 else "even"

    results = run(elements, VALUES, outputs=("first", "second", "third"), dims={"second": "k"})
    assert results.first.values.tolist() == [1, 2] and results.second.dims == ("a", "k")
    assert results.second.values.tolist() == [[1, 2], [2, 3]]
    assert results.third.values.tolist() == ["odd", "even"]
    message = "elements returned 3 values, but must return first, second"
    with pytest.warns(CallsFailedWarning, match=message):
        run(elements, VALUES, outputs=("first", "second"), store="t")


def test_frame_and_single_named_output_become_variables(run):
    results = run(frame, VALUES, store="f")
    assert results.u.sel(a=2, row="y").item() == 4 and results.v.dims == ("a", "row")
    found = run(lambda a: 1j if a == 2 else a, VALUES, outputs="turn", store="t").turn
    assert found.dtype == complex and found.values.tolist() == [1, 1j]


def test_arrays_of_different_length_are_padded(run, capsys):
    assert run(uneven, {"a": [2]}, store="t").uneven.dims == ("a", "uneven_0")
    results = run(uneven, {"a": [1, 3]}, dims="bin").uneven
    np.testing.assert_array_equal(results, [[0, np.nan, np.nan], [0, 1, 2]])
    message = "sweeps: uneven is padded with NaN along bin (1 to 3 values)\n"
    assert capsys.readouterr().err == message


def test_variables_missing_from_a_call_are_nan(run):
    results = run(lambda a: {"one": a} if a == 1 else {"one": a, "other": -a}, VALUES)
    np.testing.assert_array_equal(results.other, [np.nan, -2])


@pytest.mark.parametrize("unit", ["D", "us"])
def test_datetime64_values_and_results_keep_their_type(run, unit):
    axis = np.array(["2021-01-01", "2020-01-01"], f"M8[{unit}]")
    results = run(later, {"t": axis, "days": [1, 2]})
    assert {type(time) for time in CALLS} == {np.datetime64}
    assert {time.dtype for time in CALLS} == {axis.dtype} and len(CALLS) == 4
    assert results.later.sel(t="2020-01-01", days=2).values == np.datetime64("2020-01-03")
    assert results.t.values.tolist() == np.sort(axis).astype("M8[ns]").tolist()
    again = run(later, {"t": [*axis, np.datetime64("2022", unit)], "days": [1, 2]})
    assert len(CALLS) == 2 and again.sel(t=np.sort(axis)).equals(results)


def test_python_datetimes_are_stored_as_datetime64(run):
    times = [datetime(2020, 1, 1), datetime(2020, 2, 1, 3)]
    results = run(later, {"t": times, "days": [0]})
    assert all(type(time) is datetime for time in CALLS)
    assert results.t.values.tolist() == np.array(times, "M8[ns]").tolist()
    with pytest.warns(CallsFailedWarning):  # the call that returns the year 1 fails
        missing = run(lambda a: datetime(1 if a == 1 else 2020, 1, a), VALUES, store="m").result
    assert np.isnat(missing.values).tolist() == [True, False]
    assert missing.values[1] == np.datetime64("2020-01-02")


def test_ragged_results_take_labels_of_the_longest(run):
    results = run(labelled, {"a": [1, 3]})
    assert results.k.dtype == int and results.k.values.tolist() == [5, 6, 7]
    assert results.name.values.tolist() == ["a", "bb", "ccc"]
    assert results.side.dims == ("k",) and results.side.values.tolist() == [False, True, True]
    assert results.t.sel(a=3).values.tolist() == ["a", "b", "c"]
    assert results.t.sel(a=1).values.tolist() == ["a", "", ""]


def test_sweep_completes_when_all_calls_fail(run):
    with pytest.warns(CallsFailedWarning, match="2 of 2 calls failed"):
        results = run(lambda a: 1 / 0, VALUES, outputs=("u", "v"))
    assert np.isnan(results.u).all() and results.v.dims == ("a",)


def test_an_interrupt_ends_the_sweep(run):
    def interrupted(a):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(interrupted, VALUES, version="1")


def test_examples_in_the_docs_give_the_results_shown(monkeypatch, tmp_path, capsys):
    page = Path(__file__).parents[2] / "docs" / "one_function.md"
    text = page.read_text(encoding="utf-8")
    code, cases = re.findall(r"```py(?:thon)?\n(.*?)```", text, re.S)[:2]
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    exec(code, names)
    assert "[[ 2.,  4.,  8.],\n       [ 3.,  9., 27.]]" in capsys.readouterr().out
    exec(cases.replace("sweeps.sweep(power", "found = sweeps.sweep(power"), names)
    found = names["found"].power
    assert found.sel(case="a").item() == 1024 and found.values.tolist() == [1024, 243]


def test_a_fixed_argument_may_be_named_like_an_attribute_of_the_store(run):
    """Every group has the attributes `seed` and `version`; xarray uses `coordinates`."""

    def total(x, seed, version, coordinates):
        return x + seed + version + coordinates

    fixed = {"seed": 3, "version": 5, "coordinates": 7}
    results = run(total, xr.Dataset({"x": ("x", [1, 2]), **fixed}))
    assert results.total.values.tolist() == [16, 17]
    assert {name: results[name].item() for name in fixed} == fixed


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (lambda a: xr.DataArray([1.0, 2.0], {"bin": [a, a + 1]}), "other labels of the dimension"),
        (lambda a: "text" if a == 2 else a, "returned result as numbers and as texts"),
    ],
)
def test_inconsistent_results_are_refused(run, function, sentence):
    with pytest.raises(DeclarationError, match=sentence):
        run(function, VALUES)


def test_attrs_for_unknown_names_are_reported(run, capsys):
    found = run(lambda a: a, VALUES, attrs={"a": {"units": "m"}, "hieght": {"units": "m"}})
    assert found.a.units == "m"
    said = capsys.readouterr().err
    assert said == "sweeps: attrs has 'hieght', which is neither a result nor an argument\n"


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (lambda a: None, "returned None as .*; a return may be missing"),
        (lambda a: {"a": a}, "variable 'a', but 'a' is the name of an argument"),
        (lambda a: {"x": {"y": a}, "z": {"y": a}}, "returned the variable 'y' twice; rename one"),
    ],
)
def test_unstorable_result_fails_its_call(run, function, sentence):
    with pytest.warns(CallsFailedWarning, match=sentence):
        run(function, VALUES)


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ({"dims": "uneven"}, "dims has 'uneven', the name of a result"),
        ({"dims": "a"}, "dims has 'a', the name of an argument"),
        ({"dims": ("k", "k")}, "dims has 'k', the name of two of them"),
        ({"dims": 3}, "dims is 3, but must be a name or a tuple of names"),
        ({"outputs": ("a", "b")}, "outputs has 'a', the name of an argument"),
        ({"attrs": {"a": "m"}}, r"attrs\['a'\] is 'm', but must be as in {'a': {'units': 'm'}}"),
        ({"dtype": "f9"}, "has the dtype 'f9', unknown to numpy"),
        ({"cluster": "slurm"}, "cluster is 'slurm', but must be 'inline' or 'local'"),
        ({"store": 3}, "store is 3, but must be a path or a URL"),
        ({"seed": -1}, "seed has -1"),
    ],
)
def test_wrong_arguments_are_refused_before_any_call(run, how, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        run(uneven, VALUES, **how)


# values as a data set -----------------------------------------------------------------------------


def test_variables_sharing_a_dimension_are_zipped(run):
    dataset = xr.Dataset(
        {"a": ("case", [3, 1, 1]), "b": ("case", [5, 6, 6]), "c": 7},
        {"case": ["x", "y", "z"], "note": ("case", [0.5, 0.25, 0.5], {"units": "m"})},
    )
    results = run(plus, dataset)
    assert results.plus.dims == ("case",) and results.plus.values.tolist() == [357, 167, 167]
    assert CALLS == [(3, 5, 7), (1, 6, 7)]  # equal arguments are called once
    assert set(results.coords) == {"a", "b", "c", "case", "note"} and results.c.item() == 7
    xr.testing.assert_equal(results.drop_vars("plus"), dataset.set_coords(["a", "b", "c"]))
    assert results.note.attrs["units"] == "m"
    new = dataset.drop_vars("c").isel(case=[0]).assign(a=("case", [4]), case=["w"])
    more = xr.concat([dataset.drop_vars("c"), new], "case").assign(c=7)
    assert run(plus, more).plus.values.tolist() == [357, 167, 167, 457]
    assert CALLS == [(4, 5, 7)]


def test_variables_on_separate_dimensions_are_crossed(run):
    dataset = xr.Dataset({"a": ("i", [2, 1]), "b": ("j", [3, 4, 5])}, {"j": [30, 40, 50]})
    results = run(plus, dataset)
    assert results.plus.dims == ("i", "j") and results.sizes == {"i": 2, "j": 3}
    assert results.plus.values.tolist() == [[230, 240, 250], [130, 140, 150]]
    assert "i" not in results.coords and results.j.values.tolist() == [30, 40, 50]
    index = run(plus, xr.Dataset(coords={"a": [2, 1]}), store="t")
    assert index.plus.dims == ("a",) and index.plus.sel(a=2).item() == 200


def test_failed_calls_of_a_data_set_are_named_by_their_arguments(run):
    dataset = xr.Dataset({"a": ("i", [2, 0]), "b": ("i", [3, 4])})
    with pytest.warns(CallsFailedWarning, match="result a=0,? b=4: ZeroDivisionError"):
        run(lambda a, b: b / a, dataset)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (
            xr.Dataset({"a": (("i", "j"), np.ones((2, 2)))}),
            "has the dimensions i, j, but must have",
        ),
        (xr.Dataset({"z": ("i", [1])}), "values has 'z', but plus takes a, b, c"),
        (xr.Dataset({"a": 1}, {"i": [1, 2]}), "values has the dimension 'i', along which"),
    ],
)
def test_data_sets_without_a_valid_grid_are_refused(run, given, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        run(plus, given)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    values=of_numpy.arrays(
        st.sampled_from(["f8", "c16", "f4", "i4", "M8[us]", "?"]),
        st.tuples(st.integers(1, 3), st.integers(0, 3)),
        elements=None,
    )
)
def test_any_array_round_trips(tmp_path_factory, values):
    """A function returns an array row by row; the result is the whole array."""
    if values.dtype.kind == "M":
        values = np.abs(values.astype(int) % 10**15).astype(values.dtype)
    folder = tmp_path_factory.mktemp("any")
    options = {"store": folder / "s", "cache": folder / "c", "dims": "own", "version": "1"}
    results = sweeps.sweep(lambda row: values[row], {"row": range(len(values))}, **options)
    np.testing.assert_array_equal(results.result.values, values)
