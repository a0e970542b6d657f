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
def run(tmp_path, monkeypatch):
    """Return a function that sweeps another in a new folder."""
    monkeypatch.chdir(tmp_path)

    def swept(function, values, **options):
        CALLS.clear()
        return sweeps.sweep(function, values, **{"store": "s", "cache": "c", **options})

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


def elements(a):
    return a, [a, a + 1], "odd" if a % 2 else "even"


def turning(a):
    return 1j**a


def half(a):
    """Return a complex number for 2, the argument otherwise."""
    return 1j if a == 2 else a


def frame(a):
    return pd.DataFrame({"u": [a, 2 * a], "v": [0, 1]}, index=pd.Index(["x", "y"], name="row"))


def uneven(a):
    return np.arange(float(a))


def later(t, days):
    CALLS.append(t)
    return t + np.timedelta64(days, "D")


def python_date(a):
    return datetime(2020, 1, a)


def lacking(a):
    return {"one": a} if a == 1 else {"one": a, "other": -a}


def shifted(a):
    return xr.DataArray([1.0, 2.0], {"bin": [a, a + 1]})


def labelled(a):
    """Return a data set with more labels for larger arguments."""
    return xr.Dataset(
        {"x": ("k", np.arange(a)), "t": ("name", list("abc"[:a]))},
        {"k": np.arange(5, 5 + a), "name": ["a", "bb", "ccc"][:a], "side": ("k", np.arange(a) > 0)},
    )


def sometimes_text(a):
    return "text" if a == 2 else a


def same(a):
    return {"a": a}


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
    assert set(results.data_vars) == {"power", "peak", "name"} and set(results.coords) == {
        "a",
        "frequency",
    }
    assert results.peak.values.tolist() == [2, 4] and results.peak.attrs["units"] == "m"
    assert results.name.values.tolist() == ["number 1", "number 2"]
    assert results.power.sel(a=2, frequency=10).item() == 0.2
    xr.testing.assert_identical(results, run(variables, VALUES))
    xr.testing.assert_identical(results, run(variables, {"a": [1, 2, 3]}).sel(a=[1, 2]))


def test_a_mapping_becomes_variables(run):
    results = run(mapping, VALUES, dims={"flat": "side"}, attrs={"peak": {"units": "m"}})
    assert set(results.data_vars) == {"power", "peak", "flat"}
    assert results.flat.dims == ("a", "side") and results.flat.values.tolist() == [[1, 1], [2, 2]]
    assert results.peak.attrs["units"] == "m" and results.power.attrs["units"] == "W"


def test_a_tuple_becomes_variables(run):
    results = run(elements, VALUES, outputs=("first", "second", "third"), dims={"second": "k"})
    assert results.first.values.tolist() == [1, 2] and results.second.values.tolist() == [
        [1, 2],
        [2, 3],
    ]
    assert results.third.values.tolist() == ["odd", "even"] and results.second.dims == ("a", "k")
    with pytest.warns(
        CallsFailedWarning, match="elements returned 3 values, but must return first, second"
    ):
        run(elements, VALUES, outputs=("first", "second"), store="t")


def test_a_frame_and_one_named_output(run):
    results = run(frame, VALUES, store="f")
    assert results.u.sel(a=2, row="y").item() == 4 and results.v.dims == ("a", "row")
    assert list(run(turning, VALUES, outputs="turn", store="t")) == ["turn"]


@pytest.mark.parametrize("function", [turning, half])
def test_complex_numbers(run, function):
    results = run(function, {"a": [1, 2, 3]})[function.__name__]
    assert results.dtype == complex and results.values.tolist() == [
        complex(function(a)) for a in (1, 2, 3)
    ]


def test_arrays_without_names_of_dimensions_get_some(run):
    assert run(uneven, {"a": [2]}).uneven.dims == ("a", "uneven_0")


def test_arrays_of_different_length_are_padded(run, capsys):
    results = run(uneven, {"a": [1, 3]}, dims="bin").uneven
    np.testing.assert_array_equal(results, [[0, np.nan, np.nan], [0, 1, 2]])
    message = "sweeps: uneven is padded with NaN along bin (1 to 3 values)\n"
    assert capsys.readouterr().err == message


def test_a_variable_that_a_call_does_not_return_is_missing_there(run):
    results = run(lacking, VALUES)
    np.testing.assert_array_equal(results.other, [np.nan, -2])


@pytest.mark.parametrize("unit", ["D", "s", "ms", "us", "ns"])
def test_times_stay_times(run, unit):
    axis = np.array(["2021-01-01", "2020-01-01"], f"M8[{unit}]")
    results = run(later, {"t": axis, "days": [1, 2]})
    assert {type(time) for time in CALLS} == {np.datetime64}
    assert {time.dtype for time in CALLS} == {axis.dtype} and len(CALLS) == 4
    assert results.later.sel(t="2020-01-01", days=2).values == np.datetime64("2020-01-03")
    assert results.t.values.tolist() == np.sort(axis).astype("M8[ns]").tolist()
    again = run(later, {"t": [*axis, np.datetime64("2022", unit)], "days": [1, 2]})
    assert len(CALLS) == 2 and again.sel(t=np.sort(axis)).equals(results)


def test_times_of_python(run):
    times = [datetime(2020, 1, 1), datetime(2020, 2, 1, 3)]
    results = run(later, {"t": times, "days": [0]})
    assert all(type(time) is datetime for time in CALLS)
    assert results.t.values.tolist() == np.array(times, "M8[ns]").tolist()
    results = run(python_date, VALUES, store="p").python_date
    assert results.values.tolist() == np.array(["2020-01-01", "2020-01-02"], "M8[ns]").tolist()
    with pytest.warns(CallsFailedWarning):  # the call that returns the year 1 fails
        missing = run(
            lambda a: np.datetime64("0001") if a == 1 else python_date(a), VALUES, store="m"
        )
    assert np.isnat(missing.result.values).tolist() == [True, False]


def test_labels_that_longer_results_have_more_of(run):
    results = run(labelled, {"a": [1, 3]})
    assert results.k.dtype == int and results.k.values.tolist() == [5, 6, 7]
    assert results.name.values.tolist() == ["a", "bb", "ccc"]
    assert results.side.dims == ("k",) and results.side.values.tolist() == [False, True, True]
    assert results.t.sel(a=3).values.tolist() == ["a", "b", "c"]
    assert results.t.sel(a=1).values.tolist() == ["a", "", ""]


def test_all_calls_may_fail(run):
    with pytest.warns(CallsFailedWarning, match="2 of 2 calls failed"):
        results = run(lambda a: 1 / 0, VALUES, outputs=("u", "v"))
    assert np.isnan(results.u).all() and results.v.dims == ("a",)


def test_an_interrupt_ends_the_sweep(run):
    def interrupted(a):
        CALLS.append(a)
        if a == 2:
            raise KeyboardInterrupt
        return a

    with pytest.raises(KeyboardInterrupt):
        run(interrupted, {"a": [1, 2, 3]}, version="1")
    assert CALLS == [1, 2]


def test_what_the_page_shows_is_so(monkeypatch, tmp_path, capsys):
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


def test_a_fixed_argument_may_be_named_like_an_attribute_of_the_store(tmp_path):
    """Every group has the attributes `seed` and `version`; xarray uses `coordinates`."""

    def total(x, seed, version, coordinates, gain):
        return x + seed + version + coordinates + gain

    fixed = {"seed": 3, "version": 5, "coordinates": 7, "gain": 9}
    values = xr.Dataset({"x": ("x", [1, 2]), **fixed})
    results = sweeps.sweep(total, values, store=tmp_path / "s.zarr", cache=tmp_path / "c")
    assert results.total.values.tolist() == [25, 26]
    assert {name: results[name].item() for name in fixed} == fixed
    stored = xr.open_zarr(tmp_path / "s.zarr", group="total").attrs
    assert stored["seed"] == 0 and stored["gain"] == 9


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (shifted, "shifted returned other labels of the dimension 'bin'"),
        (sometimes_text, r"returned sometimes_text as numbers and as texts"),
    ],
)
def test_results_that_do_not_fit_together_are_refused(run, function, sentence):
    with pytest.raises(DeclarationError, match=sentence):
        run(function, VALUES)


def test_no_variable_of_a_result_replaces_another(run):
    """A mapping of mappings fails if two inner mappings have the same name."""
    with pytest.warns(CallsFailedWarning, match="returned the variable 'y' twice; rename one"):
        run(lambda a: {"x": {"y": a}, "z": {"y": 2 * a}}, VALUES)


def test_attributes_of_nothing_are_named(run, capsys):
    found = run(lambda a: a, VALUES, attrs={"a": {"units": "m"}, "hieght": {"units": "m"}})
    assert found.a.units == "m"
    said = capsys.readouterr().err
    assert said == "sweeps: attrs has 'hieght', which is neither a result nor an argument\n"


def test_a_call_that_returns_nothing_is_told_so(run):
    with pytest.warns(CallsFailedWarning, match="returned None as .*; a return may be missing"):
        run(lambda a: None, VALUES)


def test_a_result_named_like_an_argument_fails(run):
    with pytest.warns(CallsFailedWarning, match="variable 'a', but 'a' is the name of an argument"):
        run(same, VALUES)


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


def test_variables_that_share_a_dimension_run_together(run):
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
    more = xr.concat(
        [dataset, dataset.isel(case=[0]).assign(a=("case", [4]), case=["w"])],
        "case",
        data_vars="all",
    )
    assert run(plus, more.assign(c=7)).plus.values.tolist() == [357, 167, 167, 457]
    assert CALLS == [(4, 5, 7)]


def test_variables_on_dimensions_of_their_own_cross(run):
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
def test_a_data_set_that_is_no_grid_is_refused(run, given, sentence):
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
def test_any_array_comes_back(tmp_path_factory, values):
    """A function returns an array row by row; the result is the whole array."""
    if values.dtype.kind == "M":
        values = np.abs(values.astype(int) % 10**15).astype(values.dtype)
    folder = tmp_path_factory.mktemp("any")
    options = {"store": folder / "s", "cache": folder / "c", "dims": "own", "version": "1"}
    results = sweeps.sweep(lambda row: values[row], {"row": range(len(values))}, **options)
    np.testing.assert_array_equal(results.result.values, values)
