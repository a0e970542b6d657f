import numpy as np
import pytest
import xarray as xr

from docs._tables import fits, reproduction

ASPECTS = (0.0, 15.0, 45.0, 80.0)


def answers(values, *dims):
    """Return answers about a ship at four aspects, along further dimensions."""
    coords = {"aspect": list(ASPECTS)}
    return xr.DataArray(np.asarray(values)[..., None, :], coords, (*dims, "ship", "aspect"))


def test_percent_per_bin_ignores_missing_answers():
    correct = answers([[1, 0, 1, -1], [1, 1, -1, 0]], "replicate")
    np.testing.assert_array_equal(
        fits.percent(correct), [[50.0, 100.0, np.nan], [100.0, np.nan, 0.0]]
    )
    np.testing.assert_allclose(fits.overall_percent(correct), [200 / 3, 200 / 3])


def test_error_of_a_mean_accounts_for_correlated_draws():
    """Phases that shift all orders alike are three draws, however many orders each has."""
    shift = xr.DataArray([0.0, 3.0, 6.0], dims="phase")
    mean, error = fits.mean_and_error(shift + xr.DataArray(np.zeros(100), dims="order"))
    assert mean == 3.0
    assert error == pytest.approx(np.std([0, 3, 6], ddof=1) / np.sqrt(3))


def test_a_fit_marks_the_value_nearest_to_the_source():
    """A draw lies 10 off the mean of two; the means are 20, 0 and 5 off the source."""
    ours = xr.DataArray(
        [[[20.0], [40.0]], [[40.0], [60.0]], [[45.0], [65.0]]],
        {"radius": [0.1, 0.2, 0.3]},
        ("radius", "replicate", "group"),
    )
    rows = fits.fit_rows("radius", 0.3, [fits.Part("bow", ours, [50.0])], {"shown": ours})
    assert [row["value"] for row in rows] == ["0.1", "0.2", "0.3 (default)"]
    assert [row["bow"] for row in rows] == ["20.0 (14.1)", "0.0 (14.1) *", "5.0 (14.1)"]
    assert rows[1]["shown"] == "50 ± 20"


def test_table_1_follows_from_one_contrast():
    _, _, printed, found = reproduction.sensor()
    assert (printed, found) == ("0.76 K, 58.0; 0.27 K, 7.2", "0.76 K, 57.5; 0.27 K, 7.2")
