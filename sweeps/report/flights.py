"""Flights on the screen: images against the truth, landmarks of profiles, wrong parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sweeps.axes import OF_FLIGHT
from sweeps.flight_comparison import PERRY
from sweeps.report.flight_words import (
    AXES,
    PUT_IN,
    SHORT,
    column,
    heading,
    print_whole,
    shown,
    value_at,
    which,
)
from sweeps.report.screen import NOTHING, WIDTH
from sweeps.report.tables import Row

LANDMARKS = {  # heading, digits, what the source says of the synthetic and of the measured ship
    "stern_to_hangar": ("stern to hangar [m]", 1, "same"),
    "stern_to_bridge": ("stern to bridge [m]", 1, "same"),
    "transom_ratio": ("transom / hangar", 2, "large, none"),
    "transom_energy": ("  within 1.5 m", 2, ""),
    "deck_spikes": ("deck spikes", 0, "three, none"),
    "mast_position": ("mast past hangar [m]", 1, "same"),
    "mast_ratio": ("mast / hangar", 2, "less, more"),
    "mast_energy": ("  within 1.5 m", 2, ""),
    "forward_position": ("bridge past hangar [m]", 1, "same"),
    "forward_ratio": ("bridge / hangar", 2, ""),
}
FIGURES = ("looks", "correlation", "no hangar", "mast [deg]", "waterline [deg]", "hangar [m]")
SISTERS = ("duncan", 4.0, "roberts", 3.9)
"""Of the source's Figure 16: the synthetic ship and the measured one, with their ranges [km]."""


def flight_rows(flights: xr.Dataset) -> list[Row]:
    """Every figure of every flight, mean and scatter over draws of the noise.

    Parameters
    ----------
    flights : xarray.Dataset
        The store's group `validation`.

    Returns
    -------
    list of dict
        One row a flight, figure and source of profiles: axes, mean, standard deviation between
        draws, their number, units.
    """
    rows: list[Row] = []
    for axes, flight in _flights(flights):
        for name, values in flight.data_vars.items():
            over = [dim for dim in values.dims if dim == "replicate"]
            if set(values.dims) - {"replicate", "source"}:
                continue  # profiles and images are no figures
            mean, scatter = values.mean(over), values.std(over, ddof=1 if _draws(values) > 1 else 0)
            for source in values.source.values if "source" in values.dims else (None,):
                part = (here.sel(source=source) if source else here for here in (mean, scatter))
                figure, spread = (float(here) for here in part)
                rows.append(
                    {column(axis): place for axis, place in axes.items()}
                    | {
                        "figure": name,
                        "source": source,
                        "value": None if math.isnan(figure) else round(figure, 5),
                        "standard_deviation": round(spread, 5) if _draws(values) > 1 else None,
                        "draws": _draws(values),
                        "units": values.attrs.get("units", "1"),
                    }
                )
    return rows


def print_flights(flights: xr.Dataset, console: Console) -> None:
    """Print how well flights are corrected, and what their profiles show."""
    console.width = max(console.width, WIDTH)
    if flights.sizes.get("error", 1) > 1:
        print_sensitivity(flights, console)
        return
    _print_images(flights, console)
    if not np.isnan(flights.stern_to_hangar.values).all():
        _print_landmarks(flights, console)


def _print_images(flights: xr.Dataset, console: Console) -> None:
    several = [name for name in AXES if flights.sizes.get(name, 1) > 1 or name == "ship"]
    table = Table(title="Corrected images and profiles against the noiseless truth")
    for name in several:
        table.add_column(escape(heading(name)))
    for text in FIGURES:
        table.add_column(escape(text), justify="right")
    for axes, flight in _flights(flights):
        if bool(np.isnan(flight.looks).all()):  # of a ship that is not flown past
            continue
        table.add_row(
            *(shown(axes[name]) for name in several),
            f"{float(flight.looks.mean()):.1f}",
            _mean(flight.profile_correlation, 3),
            _mean(flight.profile_correlation_without_hangar, 3),
            _mean(flight.mast_tilt, 2),
            _mean(flight.waterline_tilt, 2),
            _mean(flight.hangar_spike_offset, 2),
        )
    print_whole(table, console)
    _print_worst(flights, console)
    console.print(
        "Means over draws of the noise, and the standard deviation of one: correlation of "
        "profiles, also without the hangar's peak and 4 m either side; by how much masts lean to "
        "the right and the waterline rises to it; by how far the hangar's peak is off.",
        style="dim",
    )
    if set(SHORT) & set(several):
        console.print(PUT_IN, style="dim")


def _print_worst(flights: xr.Dataset, console: Console) -> None:
    """Of all flights, every draw by itself."""
    count = int(flights.looks.count())
    likeness, beside = (
        float(flights[name].min())
        for name in ("profile_correlation", "profile_correlation_without_hangar")
    )
    leans = [float(abs(flights[f"{name}_tilt"]).max()) for name in ("mast", "waterline")]
    if count and not any(map(math.isnan, leans)):
        console.print(
            f"Worst of {count} flights, each draw by itself: correlation {likeness:.3f}, without "
            f"the hangar {beside:.3f}; mast {leans[0]:.2f} deg, waterline {leans[1]:.2f} deg."
        )


def _print_landmarks(flights: xr.Dataset, console: Console) -> None:
    """The source's Figure 16 as numbers; of a ship without her sister, beside herself noiseless."""
    near = flights.sel(aspect=175.0, method="nearest")
    there = [name for name in PERRY if landmarks_told(near, name)]
    synthetic, flown_past = SISTERS[::2]
    sisters = {synthetic, flown_past} <= set(there)
    for name in [flown_past] if sisters else there:
        flown = near.sel(ship=name).sel(range=SISTERS[3], method="nearest")
        one, title = nominal(flown), f"{name.capitalize()}, flown past, {float(flown.range):g} km"
        if sisters:
            drawn = nominal(near.sel(ship=synthetic).sel(range=SISTERS[1], method="nearest"))
            title = f"{synthetic.capitalize()}, synthetic, {float(drawn.range):g} km; {title}"
            columns = {
                f"{synthetic.capitalize()}\npoint": drawn.sel(source="point"),
                "\nspread": drawn.sel(source="synthetic"),
                f"{name.capitalize()}\nmeasured": one.sel(source="measured"),
            }
        else:
            columns = {
                f"{name.capitalize()}\nnoiseless": one.sel(source="noiseless"),
                "\nmeasured": one.sel(source="measured"),
            }
        gains = [np.atleast_1d(flown[name].values) for name in ("transom_gain", "mast_gain")]
        if 0.0 in gains[0] and 1.0 in gains[0]:
            columns["dark\ntransom*"] = nominal(flown, transom_gain=0.0).sel(source="measured")
        glint = float(np.max(gains[1]))
        if glint > 1 and 1.0 in gains[1]:
            put_in = nominal(flown, mast_gain=glint)
            columns[f"masts*\nx {glint:g}"] = put_in.sel(source="measured")
        own = ("ship", "aspect", "range", "transom_gain", "mast_gain")
        title += which(one, flights, but=own)
        for axis, values in zip(own[3:], gains, strict=True):
            if 1.0 not in values:  # put in everywhere
                title += f", {SHORT[axis]} x {float(one[axis]):g}"
        starred = any("*" in text for text in (title, *columns))
        _print_marks(f"Near stern: {title}", columns, console)
    if there:
        console.print(
            "* Put in on the source's word, which explains what it measured by a transom at 45 deg "
            "and by specular struts: inputs, no results. "
            * starred
            + "Heights are of single 1 m bins. `source`: what it says of the synthetic ship and of "
            "the measured one.",
            style="dim",
        )


def _print_marks(title: str, columns: dict[str, xr.Dataset], console: Console) -> None:
    table = Table(title=title)
    table.add_column("")
    table.add_column("source", style="dim")
    for text in columns:
        table.add_column(text, justify="right")
    for name, (text, digits, said) in LANDMARKS.items():
        table.add_row(escape(text), said, *(_mean(one[name], digits) for one in columns.values()))
    print_whole(table, console)


def landmarks_told(near: xr.Dataset, ship: str) -> bool:
    """Whether landmarks of a ship are in a store, of near-stern flights."""
    if ship not in near.ship.values.tolist():
        return False
    marks = nominal(near.sel(ship=ship).sel(range=SISTERS[3], method="nearest"))
    return bool(np.isfinite(marks.stern_to_hangar.sel(source="noiseless")).any())


def print_sensitivity(flights: xr.Dataset, console: Console) -> None:
    """Print what each wrong flight parameter costs, with and without autofocus."""
    focused = flights.sizes.get("autofocus", 1) > 1
    headings = ("correlation", *(("with autofocus", "closing speed then") if focused else ()))
    told_alone = ("ship", "aspect", "range", "error", "autofocus")
    for axes, flight in _flights(flights, but=("error", "autofocus")):
        if bool(np.isnan(flight.looks).all()):  # of a ship that is not flown past
            continue
        table = Table(
            title=f"Wrong flight parameters: {axes['ship']}, aspect {axes['aspect']:g} deg, "
            f"{axes['range']:g} km{which(flight, flights, but=told_alone)}"
        )
        table.add_column("parameter")
        table.add_column("error", justify="right")
        for text in headings:
            table.add_column(text, justify="right")
        for k in range(flight.sizes["error"]):
            one = flight.isel(error=k)
            row = [_mean((one.sel(autofocus=False) if focused else one).profile_correlation, 3)]
            if focused:
                after = one.sel(autofocus=True)
                row.append(_mean(after.profile_correlation, 3))
                row.append(_mean(100 * after.closing_speed_error, 2, "%"))
            parameter, amount = value_at(one, "error")
            table.add_row(shown(parameter), f"{amount:g}", *row)
        print_whole(table, console)
    console.print(
        "Correlation of the measured profile with the noiseless one, mean over draws with the "
        "standard deviation of one. Errors of the aircraft's speed in percent, of the ship's in "
        "m/s, of headings and pointing in deg; all else is known.",
        style="dim",
    )


def _flights(flights: xr.Dataset, *, but: tuple[str, ...] = ()) -> Iterator[tuple[Row, xr.Dataset]]:
    """Each flight with its place on the axes, draws together."""
    dims = [name for name in AXES if name in flights.dims and name not in but]
    for place in np.ndindex(*(flights.sizes[name] for name in dims)):
        one = flights.isel(dict(zip(dims, place, strict=True)))
        yield (
            {
                name: _value(one[name].item())
                for name in (*AXES, "error_parameter", "error_value")
                if name in one.coords and not one[name].dims
            },
            one,
        )


def _value(value: Any) -> Any:
    """A value of an axis; none where it was left to the heading, or to the ship."""
    return None if isinstance(value, float) and math.isnan(value) else value


def _draws(values: xr.DataArray) -> int:
    return int(values.sizes.get("replicate", 1))


def _mean(values: xr.DataArray, digits: int, unit: str = "") -> str:
    """A mean over draws and what one of them scatters."""
    found = np.asarray(values, dtype=float).ravel()
    found = found[np.isfinite(found)]
    if not found.size:
        return NOTHING
    text = f"{round(found.mean(), digits) + 0.0:.{digits}f}{unit}"
    scatter = found.std(ddof=1) if found.size > 1 else 0.0
    return f"{text} ±{scatter:.{digits}f}".replace("±0.", "±.") if scatter > 0 else text


def nominal(flights: xr.Dataset, *, keep: tuple[str, ...] = (), **wanted: float) -> xr.Dataset:
    """The flight of nominal inputs but for those wanted, and of the first of any other axis."""
    for name, value in ({"transom_gain": 1.0, "mast_gain": 1.0} | wanted).items():
        if name in flights.dims:
            flights = flights.sel({name: value}, method="nearest")
    others = {dim: 0 for dim in OF_FLIGHT if dim in flights.dims and dim not in keep}
    return flights.isel(others)
