"""Tables of fitted settings have the article's rows, and mark tables that are not fitted."""

import numpy as np
import pytest
import xarray as xr

from docs._tables import reproduced
from ncti.article import figures
from studies.reproduction.assumptions import PRIORS, assumed
from studies.reproduction.fits import FITS

NAMES = [f"Table {figure.table}, {figure.name}" for figure in figures()]
SETTINGS = 16


@pytest.fixture(scope="module")
def reports():
    """Return reports of figures that rise from 0, of fits that weigh one setting, of parameters."""
    count, fits = len(NAMES), len(FITS)
    rising = xr.DataArray(np.arange(float(count)), {"figure": NAMES}, "figure")
    of_fits = xr.DataArray(np.zeros(fits), {"fitted": list(FITS)}, "fitted")
    table = xr.Dataset(
        {
            **{name: rising + of_fits for name in ("percent", "percent_low")},
            "percent_high": rising + of_fits + 1,
            **{name: rising for name in ("article", "least", "largest", "nearest")},
            "agreeing": rising / 100,
        }
    )
    weight = np.zeros((fits, SETTINGS))
    weight[:, 5] = 1.0
    tables = xr.DataArray([2, 3, 4, 5], dims="table", name="table")
    distance = (of_fits + tables).assign_coords(table=tables)
    made = xr.Dataset(
        {
            "distance": distance,
            "best": distance + 1,
            "least": distance.isel(fitted=0, drop=True),
            "temperature": of_fits + 2,
            "effective": of_fits + 1,
            "together": xr.DataArray(7),
            "weight": (("fitted", "setting"), weight),
        },
        {"setting": np.arange(SETTINGS)},
    )
    drawn = [assumed(number) for number in range(SETTINGS)]
    value = [[prior.number(one[name]) for name, prior in PRIORS.items()] for one in drawn]
    settings = xr.Dataset(
        {"value": (("setting", "parameter"), value)},
        {"setting": np.arange(SETTINGS), "parameter": list(PRIORS)},
    )
    most = np.tile(np.arange(len(PRIORS))[::-1], (fits, 1)) / 10
    by = ("fitted", "parameter")
    parameters = xr.Dataset(
        {
            "information": (by, most),
            **{f"median{end}": (by, np.tile(value[5], (fits, 1))) for end in ("", "_low", "_high")},
        },
        {"fitted": list(FITS), "parameter": list(PRIORS)},
    )
    return (
        reproduced.figure_report(table, ""),
        reproduced.fit_report(made, len(NAMES), ""),
        reproduced.parameter_report(parameters, made, settings),
    )


def test_figures_of_an_article_row_share_one_row(reports):
    rows = {row["what"]: row for row in reports[0].rows}
    assert len(rows) == 5 + 1 + 5 + 3 + 1
    assert rows["Table 2, 32 frames"]["article"] == "3 / 4 / 5"
    assert rows["Table 3, categories at 10 / 30 / 50 ns"]["range"] == "15–15 / 16–16 / 17–17"
    assert rows["Table 5, 50 km, half pixels"]["all"] == "36 / 37 / 38 (36–37 / 37–38 / 38–39)"
    assert rows["Table 5, categories"]["article"] == "42"


def test_tables_excluded_from_the_fit_are_marked(reports):
    rows = {row["fitted"]: row for row in reports[1].rows}
    assert rows["2, 3"]["table_2"] == "2.0 (3.0)" and rows["2, 3"]["table_4"] == "4.0 (5.0) *"
    assert rows["4, 5"]["table_3"] == "3.0 (4.0) *" and "*" not in rows["all"].values()
    assert "*" not in "".join(rows["none (prior)"].values())


def test_a_parameter_is_shown_by_its_values(reports):
    """They are the values of the one setting that has all the weight."""
    rows, values = reports[2].rows, assumed(5)
    assert len(rows) == reproduced.MAX_PARAMETERS
    assert rows[0]["all"].startswith(f"{values['depression']} 100 %; ")
    assert rows[1]["all"].startswith(f"{values['place_right']:.3g} (")
