"""Flights on the screen: images against the truth, landmarks of profiles, and who was named."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sweeps.axes import AXES as AXIS_ATTRIBUTES
from sweeps.axes import FLIGHT_AXES, OF_FLIGHT
from sweeps.report.screen import NOTHING, WIDTH, grouped
from sweeps.report.tables import Row, cells, percent

AXES = ("ship", "aspect", "range", *OF_FLIGHT)
WRITTEN = {"degree": "deg", "m s-1": "m/s", "urad": "µrad", "1": ""}  # of units that need it
UNITS = {
    name: unit
    for name, attributes in (AXIS_ATTRIBUTES | FLIGHT_AXES).items()
    if name in AXES
    and (unit := WRITTEN.get(attributes.get("units", "1"), attributes.get("units", "1")))
}
SHORT = {"transom_gain": "transom*", "mast_gain": "masts*"}
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
MEASURED_AXES = (
    *("pulse_width", "classifier", "vigilance", "range", *OF_FLIGHT, "replicate", "kind"),
    "aspect_bin",
)
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
                    axes
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
    several = [name for name in AXES if flights.sizes.get(name, 1) > 1 or name in ("ship",)]
    table = Table(title="Corrected images and profiles against the noiseless truth")
    for name in several:
        unit = f" [{UNITS[name]}]" if name in UNITS else ""
        table.add_column(escape(SHORT.get(name, name.replace("_", " ")) + unit))
    for heading in (
        "looks",
        "correlation",
        "no hangar",
        "mast [deg]",
        "waterline [deg]",
        "hangar [m]",
    ):
        table.add_column(escape(heading), justify="right")
    for axes, flight in _flights(flights):
        if bool(np.isnan(flight.profile_correlation).all()):
            continue
        table.add_row(
            *(_shown(axes[name]) for name in several),
            f"{float(flight.looks.mean()):.1f}",
            _mean(flight.profile_correlation, 3),
            _mean(flight.profile_correlation_without_hangar, 3),
            _mean(flight.mast_tilt, 2),
            _mean(flight.waterline_tilt, 2),
            _mean(flight.hangar_spike_offset, 2),
        )
    console.print(table)
    console.print(
        "Means over draws of the noise, and the standard deviation of one: correlation of "
        "profiles, also without the hangar's peak and 4 m either side; by how much masts lean to "
        "the right and the waterline rises to it; by how far the hangar's peak is off.",
        style="dim",
    )
    if set(SHORT) & set(several):
        console.print(
            "* Put in: what the transom and the masts reflect, over the rest of the ship.",
            style="dim",
        )


def _print_landmarks(flights: xr.Dataset, console: Console) -> None:
    """The source's Figure 16 as numbers, or of each ship's own profiles where sisters lack."""
    flights = _near_stern(flights)
    names = set(flights.ship.values.tolist())
    if (
        not {SISTERS[0], SISTERS[2]} <= names
        or np.isnan(
            flights.stern_to_hangar.sel(ship=[SISTERS[0], SISTERS[2]], source="point")
        ).any()
    ):
        return
    drawn = flights.sel(ship=SISTERS[0]).sel(range=SISTERS[1], method="nearest")
    flown = flights.sel(ship=SISTERS[2]).sel(range=SISTERS[3], method="nearest")
    columns = {
        f"{SISTERS[0].capitalize()}\npoint": nominal(drawn).sel(source="point"),
        "\nspread": nominal(drawn).sel(source="synthetic"),
        f"{SISTERS[2].capitalize()}\nmeasured": nominal(flown).sel(source="measured"),
    }
    dark = 0.0 in np.atleast_1d(flown.transom_gain.values)
    glint = float(np.max(np.atleast_1d(flown.mast_gain.values)))
    if dark:
        columns["dark\ntransom*"] = nominal(flown, transom_gain=0.0).sel(source="measured")
    if glint > 1:
        columns[f"masts*\nx {glint:g}"] = nominal(flown, mast_gain=glint).sel(source="measured")
    table = Table(
        title=f"Near stern: {SISTERS[0].capitalize()}, synthetic, {float(drawn.range):g} km; "
        f"{SISTERS[2].capitalize()}, flown past, {float(flown.range):g} km"
    )
    table.add_column("")
    table.add_column("source", style="dim")
    for heading in columns:
        table.add_column(heading, justify="right")
    for name, (heading, digits, said) in LANDMARKS.items():
        table.add_row(
            escape(heading), said, *(_mean(column[name], digits) for column in columns.values())
        )
    console.print(table)
    console.print(
        "* Put in on the source's word, which explains what it measured by a transom at 45 deg and "
        "by specular struts: inputs, no results. Heights are of single 1 m bins. `source`: what it "
        "says of the synthetic ship and of the measured one.",
        style="dim",
    )


def print_sensitivity(flights: xr.Dataset, console: Console) -> None:
    """Print what each wrong flight parameter costs, with and without autofocus."""
    for axes, flight in _flights(flights.drop_vars("aspect_bin", errors="ignore"), but="error"):
        if bool(np.isnan(flight.profile_correlation).all()):
            continue
        focused = flight.sizes.get("autofocus", 1) > 1
        table = Table(
            title=f"Wrong flight parameters: {axes['ship']}, aspect {axes['aspect']:g} deg, "
            f"{axes['range']:g} km"
        )
        table.add_column("parameter")
        table.add_column("error", justify="right")
        for heading in (
            "correlation",
            *(["with autofocus", "closing speed then"] if focused else []),
        ):
            table.add_column(heading, justify="right")
        for k in range(flight.sizes["error"]):
            one = flight.isel(error=k)
            cells = [one.isel(autofocus=0)] if focused else [one]
            row = [_mean(cells[0].profile_correlation, 3)]
            if focused:
                after = one.isel(autofocus=1)
                row.append(_mean(after.profile_correlation, 3))
                row.append(_mean(100 * after.closing_speed_error, 2, "%"))
            table.add_row(
                str(one.error_parameter.item()).replace("_", " "),
                f"{one.error_value.item():g}",
                *row,
            )
        console.print(table)
    console.print(
        "Correlation of the measured profile with the noiseless one, mean over draws with the "
        "standard deviation of one. Errors of the aircraft's speed in percent, of the ship's in "
        "m/s, of headings and pointing in deg; all else is known.",
        style="dim",
    )


def measured_rows(tables: xr.Dataset) -> list[Row]:
    """Percent correct of measured profiles beside synthetic ones, by who learned the latter.

    Parameters
    ----------
    tables : xarray.Dataset
        The store's group `tables/measured`.

    Returns
    -------
    list of dict
        One row a setting, kind of profile and aspect bin; the ship alone is also counted, where
        a classifier names an aspect bin, too.
    """
    return [
        axes
        | {
            prefix + name: percent(cell[key])
            for prefix, start in (("", ""), ("ship_", "ship_"))
            for name, key in (
                ("percent_correct", f"{start}accuracy"),
                ("ci_low", f"{start}ci_low"),
                ("ci_high", f"{start}ci_high"),
            )
        }
        | {"n": cell["n"]}
        for axes, cell in cells(xr.broadcast(tables)[0], MEASURED_AXES)
    ]


def print_measured(rows: list[Row], console: Console) -> None:
    """Print how many measured profiles are named right, beside synthetic ones."""
    console.width = max(console.width, WIDTH)
    bins = list(dict.fromkeys(row["aspect_bin"] for row in rows))
    table = Table(title="Ships named right [%] by what synthetic profiles taught")
    for heading in ("pulse [ns]", "classifier", "profiles"):
        table.add_column(escape(heading))
    for label in bins:
        table.add_column(label, justify="right")
    for (pulse, name, kind), group in grouped(
        rows, ("pulse_width_ns", "classifier", "kind")
    ).items():
        by_bin: dict[Any, Row] = {}
        for row in group:  # of several flights the first
            by_bin.setdefault(row["aspect_bin"], row)
        table.add_row(
            f"{pulse:g}",
            str(name).upper() if len(str(name)) == 3 else str(name),
            str(kind),
            *(
                NOTHING
                if by_bin[label]["ship_percent_correct"] is None
                else f"{by_bin[label]['ship_percent_correct']:.0f} "
                f"[{by_bin[label]['ship_ci_low']:.0f}-{by_bin[label]['ship_ci_high']:.0f}]"
                for label in bins
            ),
        )
    console.print(table)
    shown = [name for name in rows[0] if name in OF_FLIGHT or name in ("range", "range_km")]
    several = [name for name in shown if len({row[name] for row in rows}) > 1]
    if several:
        values = ", ".join(f"{name.replace('_', ' ')} {rows[0][name]}" for name in several)
        console.print(f"Of {values}; the CSV has the others.", style="dim")
    console.print(
        "Of the ships flown past, the ship alone, with 95 % intervals. learned: the synthetic "
        "profiles themselves, without noise; test: averages of frames of them, with the range "
        "profiler's noise; measured: corrected images, gathered into its beams, with that of the "
        "flight alone.",
        style="dim",
    )


def _flights(flights: xr.Dataset, *, but: str = "") -> Iterator[tuple[Row, xr.Dataset]]:
    """Each flight with its place on the axes, draws together."""
    dims = [name for name in AXES if name in flights.dims and name != but]
    if but:
        dims = [name for name in dims if name != "autofocus"]
    fixed = {
        name: _value(flights[name].item())
        for name in AXES
        if name in flights.coords and not flights[name].dims
    }
    for place in np.ndindex(*(flights.sizes[name] for name in dims)):
        one = flights.isel(dict(zip(dims, place, strict=True)))
        named = {name: _value(one[name].item()) for name in dims}
        wrong = {
            name: _value(one[name].item())
            for name in ("error_parameter", "error_value")
            if name in one.coords and not one[name].dims
        }
        every = fixed | named
        yield {name: every[name] for name in AXES if name in every} | wrong, one


def _value(value: Any) -> Any:
    return value if isinstance(value, (bool, str)) else float(value)


def _shown(value: Any) -> str:
    """A value of an axis; NaN where it was left to the heading, or to the ship."""
    if isinstance(value, float):
        return NOTHING if math.isnan(value) else f"{value:g}"
    return str(value).replace("_", " ")


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


def _near_stern(flights: xr.Dataset) -> xr.Dataset:
    """The view closest to the source's, 5 deg off the stern."""
    return flights.sel(aspect=175.0, method="nearest")


def nominal(flights: xr.Dataset, *, keep: tuple[str, ...] = (), **wanted: float) -> xr.Dataset:
    """The flight of nominal inputs but for those wanted, and of the first of any other axis."""
    for name, value in ({"transom_gain": 1.0, "mast_gain": 1.0} | wanted).items():
        if name in flights.dims:
            flights = flights.sel({name: value}, method="nearest")
    others = {dim: 0 for dim in OF_FLIGHT if dim in flights.dims and dim not in keep}
    return flights.isel(others)
