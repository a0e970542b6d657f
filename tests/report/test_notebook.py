"""Charts in notebooks have the rows and scales of the page, and refuse other arguments."""

import html
import re

import numpy as np
import pytest
import xarray as xr
from made import displayed, scores
from pages import page_of, parsed, stored

from sweeps.report import chart

AXES = {"cnr": [5.0, 10.0, 20.0], "range": [25.0, 50.0]}


def document(made):
    """Return the parsed page in the frame of a notebook's output."""
    (source,) = re.findall(
        r'^<iframe srcdoc="(.*?)" sandbox="allow-scripts', made._repr_html_(), re.S
    )
    return parsed(html.unescape(source))


def test_notebook_chart_has_the_rows_and_scales_of_the_page(tmp_path):
    path = stored(tmp_path / "s.zarr", {"swept": ["cnr"]}, tables__acn=displayed(scores(**AXES)))
    ds = xr.open_zarr(path, group="tables/acn")
    in_notebook = document(chart(ds, x="cnr", y="accuracy", colour="range"))
    page = parsed(page_of(path)).data["tables"]["scores"]
    assert in_notebook.data["tables"]["chart"]["figures"] == page["figures"]
    assert in_notebook.data["tables"]["chart"]["x"] == page["x"]
    for name in ("cnr_db", "range_km", "percent_correct", "ci_low"):
        assert in_notebook.data["tables"]["chart"]["rows"][name] == page["rows"][name]
    for name, chosen in (("against", "cnr_db"), ("colour", "range_km")):
        (option,) = in_notebook.root.only("select", id=name).all("option", selected="")
        assert option.attrs["value"] == chosen
    assert in_notebook.root.only("meta", http_equiv="Content-Security-Policy")


def test_chart_accepts_undeclared_tables_and_selections():
    table = xr.Dataset(
        {"height": (("age", "tree"), np.eye(2))}, {"age": [1, 2], "tree": ["a", "<b>"]}
    )
    in_notebook = document(chart(table, x="age", colour="tree"))
    assert in_notebook.data["tables"]["chart"]["figures"].keys() == {"height"}
    assert not in_notebook.root.all("b")
    selection = document(chart(table.sel(tree="a"), x="age"))
    assert selection.data["tables"]["chart"]["rows"]["height"] == [1.0, 0.0]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"x": "age"}, "x is 'age', but must be one of cnr, range, aspect_bin"),
        ({"x": ""}, "x is '', but must be one of"),
        ({"x": "cnr", "y": "height"}, "y is 'height', but must be one of accuracy, ci_low"),
        ({"x": "cnr", "colour": "age"}, "colour is 'age', but must be one of cnr"),
        ({"x": "cnr", "colour": "cnr"}, "colour is 'cnr', but must differ from x"),
    ],
)
def test_chart_refuses_invalid_arguments(arguments, said):
    with pytest.raises(ValueError, match=f"^{re.escape(said)}"):
        chart(displayed(scores(**AXES)), **arguments)


def test_a_data_set_without_numbers_is_refused():
    with pytest.raises(ValueError, match=r"^the data set has no numeric variable$"):
        chart(xr.Dataset({"name": ("age", ["a", "b"])}, {"age": [1, 2]}), x="age")
