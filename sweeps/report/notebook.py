"""Charts of the report page in notebooks."""

from __future__ import annotations

import html
from dataclasses import dataclass, replace

import xarray as xr

from sweeps.engine.declare.display import Display, Figure
from sweeps.engine.store.tables import restore_scalars
from sweeps.report.frames import displays_of, main_coordinate, tidy_frame
from sweeps.report.page.content import chart_content
from sweeps.report.page.write import render_template

NAME = "chart"
HEIGHT = 520  # pixels, of a chart with its selectors


@dataclass(frozen=True)
class Chart:
    """A chart that notebooks display: a self-contained HTML document.

    Attributes
    ----------
    document : str
        HTML of the chart.
    """

    document: str

    def __repr__(self) -> str:
        return f"<Chart of {len(self.document):,} characters>"

    def _repr_html_(self) -> str:
        source = html.escape(self.document)
        return (
            f'<iframe srcdoc="{source}" sandbox="allow-scripts allow-downloads" '
            f'style="border: 0; width: 100%; height: {HEIGHT}px"></iframe>'
        )


def chart(ds: xr.Dataset, *, x: str, y: str = "", colour: str = "") -> Chart:
    """Return a chart of a figure along an axis, as the report page draws it, of about 1 MB.

    Parameters
    ----------
    ds : xarray.Dataset
        A table of a store, such as `xr.open_zarr("sweep.zarr", group="tables/acn")`, or a part of
        one. Axes of several values besides `x` and `colour` have selectors above the chart.
    x : str
        Dimension along the chart.
    y : str, optional
        Variable; by default the main figure of the table. Its interval is drawn, if any.
    colour : str, optional
        Dimension whose values have a curve each; by default as on the page.

    Returns
    -------
    Chart
        Displayed by notebooks that run scripts in outputs, such as JupyterLab.

    Raises
    ------
    ValueError
        If `y` is not a numeric variable, or `x` or `colour` is not one of its dimensions.

    Examples
    --------
    >>> import xarray as xr
    >>> from sweeps.report import chart
    >>> heights = xr.Dataset({"height": ("age", [1.0, 3.0])}, {"age": [10, 20]})
    >>> "height" in chart(heights, x="age").document
    True
    """
    table = restore_scalars(ds)
    display = _display_of(table, y)
    figure = display.figures[0].variable
    dims = list(map(str, table[figure].dims))
    for name, dim in (("x", x), ("colour", colour)):
        if dim not in dims and (dim or name == "x"):
            raise ValueError(f"{name} is {dim!r}, but must be one of {', '.join(dims)}")
    if x == colour:
        raise ValueError(f"colour is {colour!r}, but must differ from x")
    frame = tidy_frame(table, display, "")
    by_axis = frame.names_by_axis
    columns = {dim: by_axis[main_coordinate(table, dim)] for dim in (x, colour) if dim}
    content = chart_content(
        {NAME: frame}, [x], "", along=columns[x], colour=columns.get(colour, "")
    )
    return Chart(render_template("chart.html", content))


def _display_of(table: xr.Dataset, variable: str) -> Display:
    """Return the display of a table for one variable alone, or for its main figure."""
    displays = displays_of(table, NAME)
    figures = [(display, figure) for display in displays for figure in display.figures]
    numeric = [str(name) for name in table if table[name].dtype.kind in "fiu" and table[name].ndim]
    selected = (
        variable or next((figure.variable for _, figure in figures), "") or next(iter(numeric), "")
    )
    if not numeric:
        raise ValueError("the data set has no numeric variable")
    if selected not in numeric:
        raise ValueError(f"y is {variable!r}, but must be one of {', '.join(numeric)}")
    for display, figure in figures:
        if figure.variable == selected:
            return replace(display, name=NAME, figures=(figure,))
    title = str(table[selected].attrs.get("long_name", selected.replace("_", " ")))
    return Display(NAME, title[:1].upper() + title[1:], (Figure(selected),))
