"""Exact mean and covariance of the views of a data set, for classifiers that learn no noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ncti.data.views import drawn_at, drawn_lines
from ncti.labels import labelled
from ncti.ladar.budget import power_ratio
from ncti.ladar.expected import expected_profile
from ncti.ladar.extent import range_extent
from ncti.ladar.moments import banded_frame_moments
from ncti.ladar.places import TEMPLATE_PLACES, spread_place
from ncti.simulate.subject import mesh_of

if TYPE_CHECKING:
    import xarray as xr

OF_VIEW = ("ship", "variant", "aspect", "depression", "slant_range", "pulse_width", "cnr")


def moments(rows: xr.Dataset, *, places: int = TEMPLATE_PLACES) -> xr.Dataset:
    """Return the mean and covariance of one frame of each view of a data set.

    Parameters
    ----------
    rows : xarray.Dataset
        Rows of `ncti.dataset` or of a split, of ships that have names.
    places : int
        Number of places of the ship on the IFOVs: the corner, and others spread evenly.

    Returns
    -------
    xarray.Dataset
        `mean` (view, place, down_range) and `covariance` (view, lag, down_range), a lower band as
        `ncti.ladar.banded_frame_moments` returns it, at the first place, of the nominal gain and
        floor, with the ship and the parameters of the view's first row.

    See Also
    --------
    ncti.classify.GaussianTemplates : Classifier of such moments.
    ncti.dataset : Rows, each at a place of its own.

    Notes
    -----
    What an endless number of draws of these views would show, and nothing of other views.

    Examples
    --------
    >>> import ncti
    >>> rows = ncti.dataset(["duncan"], 4, seed=0, rows_per_view=2)
    >>> of_views = ncti.data.moments(rows)
    >>> of_views.sizes["view"], of_views["mean"].dims
    (2, ('view', 'place', 'down_range'))
    """
    # Imported where it is used: xarray takes a third of a second.
    import xarray as xr

    views, first = np.unique(rows.view.values, return_index=True)
    centres, about = rows.down_range.values, rows.attrs
    bin_width = float(centres[1] - centres[0])
    drawn_as = rows["variant" if "variant" in rows.coords else "ship"].values
    means, bands = [], []
    for k in first.tolist():
        aspect, depression, slant_range, pulse_width, cnr = (
            float(rows[name][k]) for name in OF_VIEW[2:]
        )
        mesh, ifov = mesh_of(str(drawn_as[k])), about["ifov_urad"] * 1e-6
        image = drawn_lines(
            mesh,
            aspect=aspect,
            depression=depression,
            slant_range=slant_range,
            range_drawn=drawn_at(mesh, slant_range, about["far_field_error"]),
            spacing=about["spacing_m"],
            ifov=ifov,
        )
        signal = {
            "pulse_width": pulse_width,
            "cnr": power_ratio(cnr),
            "target_free_ifovs": about["target_free_ifovs"],
        }
        extents = [
            range_extent(
                image,
                slant_range=slant_range,
                ifov=ifov,
                bin_width=bin_width,
                window=bin_width * len(centres),
                shift=spread_place(number),
            )
            for number in range(places)
        ]
        means.append([expected_profile(extent, **signal) for extent in extents])
        bands.append(banded_frame_moments(extents[0], **signal)[1])
    whole = np.zeros((len(bands), max(map(len, bands)), len(centres)))
    for of_view, band in zip(whole, bands, strict=True):
        of_view[: len(band)] = band
    coords = {
        name: ("view", rows[name].values[first], rows[name].attrs)
        for name in OF_VIEW
        if name in rows.coords
    }
    coords["view"] = ("view", views, rows.view.attrs)
    coords["down_range"] = rows.down_range
    return xr.Dataset(
        {
            "mean": labelled(
                ("view", "place", "down_range"), np.array(means), "1", "mean of a frame"
            ),
            "covariance": labelled(
                ("view", "lag", "down_range"), whole, "1", "covariance of bins a lag apart"
            ),
        },
        coords,
        about,
    )
