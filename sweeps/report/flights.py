"""Tables of flights: errors of images, landmarks, wrong parameters, identification."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr
from rich.console import Console

from sweeps.report.axes import (
    DRAWS,
    NOTHING,
    OF_ARRAYS,
    SHORT,
    Axis,
    axes_of,
    nominal,
    shown,
    told,
    which,
)
from sweeps.report.layout import sheet, show
from sweeps.report.rows import (
    BIN,
    ENDS,
    Row,
    cells,
    grouped,
    rounded,
    score_rows,
    several,
    together,
)
from sweeps.report.screen import PUT_IN, note, percent_text

LANDMARKS = {  # heading, digits, the source's statement on the synthetic and the measured ship
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
FIGURES = {  # of corrected images and profiles: heading and digits
    "profile_correlation": ("correlation", 3),
    "profile_correlation_without_hangar": ("no hangar", 3),
    "mast_tilt": ("mast [deg]", 2),
    "waterline_tilt": ("waterline [deg]", 2),
    "hangar_spike_offset": ("hangar [m]", 2),
}
TILTED = ("mast", "waterline")
CHANNELS = {"": "both", "intensity_": "intensity", "infrared_": "infrared"}
"""Image from which a tilt is estimated, and its heading; the first is in FIGURES, too."""

SISTERS = ("duncan", 4.0, "roberts", 3.9)
"""The synthetic and the measured ship of the source's Figure 16, with their ranges [km]."""

STERN = 175.0  # deg: the source's aspect
KEPT = ("replicate", "source", "pulse_width", "kind")  # of one flight
TITLED = ("ship", "aspect", "range")  # given in every title
GAINS = ("transom_gain", "mast_gain")
INSIDE = ("error", "error_parameter", "error_value", "autofocus")  # a table of sensitivities
NAMED = ("pulse_width_ns", "classifier", "kind")  # of measured profiles


@dataclass(frozen=True)
class Place:
    """A flight of a store: its ship's label, aspect [deg] and range [km]; nominal on other axes."""

    ship: str
    aspect: float
    range: float

    @property
    def title(self) -> str:
        """Ship, range and aspect, for a title."""
        name = shown(self.ship).capitalize()
        return f"{name} at {self.range:g} km, aspect {self.aspect:g}°, simulated"


def titled_place(one: xr.Dataset) -> str:
    """Return ship, range and aspect of one flight, for a title."""
    return Place(str(one.ship.item()), float(one.aspect), float(one.range)).title


def flight_rows(flights: xr.Dataset) -> list[Row]:
    """Return rows of mean and scatter over draws, one for every figure of every flight."""
    parts = []
    for name, values in flights.data_vars.items():
        if set(values.dims) & set(OF_ARRAYS):
            continue  # profiles and images are not figures
        over = [dim for dim in values.dims if dim in DRAWS]
        draws = math.prod(values.sizes[dim] for dim in over)
        spread = values.std(over, ddof=1 if draws > 1 else 0)
        for axes, cell in cells(xr.Dataset({"mean": values.mean(over), "spread": spread})):
            row = {"value": rounded(cell["mean"], 5)}
            row["standard_deviation"] = rounded(cell["spread"], 5) if draws > 1 else None
            said = {"draws": draws, "units": values.attrs.get("units", "1")}
            parts.append({"figure": name} | axes | row | said)
    return together(parts)


def print_flights(flights: xr.Dataset, console: Console) -> None:
    """Print how well flights are corrected, and what their profiles show."""
    if flights.sizes.get("error", 1) > 1:
        print_sensitivity(flights, console)
        return
    _print_images(flights, console)
    if not np.isnan(flights.stern_to_hangar.values).all():
        _print_landmarks(flights, console)


def flown_past(flights: xr.Dataset) -> list[str]:
    """Return the ships of a store that are flown past; the others are only in training."""
    there = np.isfinite(flights.looks).any([dim for dim in flights.looks.dims if dim != "ship"])
    names: list[str] = np.atleast_1d(flights.ship.values)[np.atleast_1d(there.values)].tolist()
    return names


def _several_axes(flights: xr.Dataset) -> list[Axis]:
    """Return the axes along which flights differ, the ship first."""
    return [
        axis
        for axis, dim in axes_of(flights.looks).items()
        if axis == "ship" or (dim and flights.sizes[dim] > 1 and not axis.number)
    ]


def _print_images(flights: xr.Dataset, console: Console) -> None:
    shown_axes = _several_axes(flights)
    headings = ["looks", *(text for text, _ in FIGURES.values())]
    left = [axis.heading for axis in shown_axes]
    title = "Simulated flights: corrected images and profiles against the noiseless truth"
    table = sheet(title, *headings, left=left)
    for axes, flight in _flights(flights):
        looks = f"{float(flight.looks.mean()):.1f}"
        figures = (_mean(flight[name], digits) for name, (_, digits) in FIGURES.items())
        table.add_row(*(shown(axes[axis]) for axis in shown_axes), looks, *figures)
    show(table, console)
    _print_worst(flights, console)
    note(
        "Means over draws of the noise, and the standard deviation of one: correlation of "
        "profiles, also without the hangar's peak and 4 m either side; tilt of masts to the right, "
        "and of the waterline rising to it; offset of the hangar's peak.",
        console,
    )
    if any(axis.name in SHORT for axis in shown_axes):
        note(PUT_IN, console)
    _print_tilts(flights, shown_axes, console)


def _print_tilts(flights: xr.Dataset, shown_axes: list[Axis], console: Console) -> None:
    """Print tilts by each image alone beside the joint ones."""
    table = sheet(
        "Simulated flights: tilts by both images together, and by each alone [deg]",
        *(f"{what}\n{word}" for what in TILTED for word in CHANNELS.values()),
        left=[axis.heading for axis in shown_axes],
    )
    names = [f"{channel}{what}_tilt" for what in TILTED for channel in CHANNELS]
    for axes, flight in _flights(flights):
        leans = (_mean(flight[name], 2) for name in names)
        table.add_row(*(shown(axes[axis]) for axis in shown_axes), *leans)
    show(table, console)
    note(
        "One tilt is fitted to both images, each weighted by its own noise. Clutter of the sea "
        "(irar.clutter) is noise of the infrared image that averaging does not reduce.",
        console,
    )


def _print_worst(flights: xr.Dataset, console: Console) -> None:
    """Print the worst errors of all flights and draws."""
    count, likeness = int(flights.looks.count()), float(flights.profile_correlation.min())
    beside = float(flights.profile_correlation_without_hangar.min())
    leans = [float(abs(flights[f"{name}_tilt"]).max()) for name in TILTED]
    if count and not any(map(math.isnan, leans)):
        note(
            f"Worst of {count} flights, each draw separately: correlation {likeness:.3f}, without "
            f"the hangar {beside:.3f}; mast {leans[0]:.2f} deg, waterline {leans[1]:.2f} deg.",
            console,
        )


def _print_landmarks(flights: xr.Dataset, console: Console) -> None:
    """Print the source's Figure 16 as numbers; a ship without a sister beside its own truth."""
    near = flights.sel(aspect=STERN, method="nearest")
    there = ships_with_masts(near)
    synthetic, flown_by = SISTERS[::2]
    sisters = {synthetic, flown_by} <= set(there)
    starred = False
    for name in [flown_by] if sisters else there:
        flown = near.sel(ship=name).sel(range=SISTERS[3], method="nearest")
        one, caption = put_in(flown), shown(name).capitalize()
        title = f"{caption}, simulated flight, {float(flown.range):g} km"
        if sisters:
            drawn = put_in(near.sel(ship=synthetic).sel(range=SISTERS[1], method="nearest"))
            title = f"{synthetic.capitalize()}, synthetic, {float(drawn.range):g} km; {title}"
            columns = {f"{synthetic.capitalize()}\npoint": drawn.sel(source="point")}
            columns["\nspread"] = drawn.sel(source="synthetic")
            columns[f"{caption}\nflown"] = one.sel(source="measured")
        else:
            columns = {f"{caption}\nnoiseless": one.sel(source="noiseless")}
            columns["\nflown"] = one.sel(source="measured")
        gains = {axis: np.atleast_1d(flown[axis].values) for axis in GAINS}
        dark, glint = float(gains["transom_gain"].min()), float(gains["mast_gain"].max())
        if dark == 0 and 1.0 in gains["transom_gain"]:
            columns["dark\ntransom*"] = put_in(flown, transom_gain=dark).sel(source="measured")
        if glint > 1 and 1.0 in gains["mast_gain"]:
            columns[f"masts*\nx {glint:g}"] = put_in(flown, mast_gain=glint).sel(source="measured")
        title += which(one, flights, but=(*TITLED, *gains))
        for axis, values in gains.items():
            if 1.0 not in values:  # assumed everywhere
                title += f", {SHORT[axis]} x {float(one[axis]):g}"
        starred = starred or any("*" in text for text in (title, *columns))
        table = sheet(f"Near stern: {title}", *columns, left=("", "source"))
        table.columns[1].style = "dim"
        for name, (text, digits, said) in LANDMARKS.items():
            table.add_row(text, said, *(_mean(one[name], digits) for one in columns.values()))
        show(table, console)
    if there:
        note(
            "* Assumed inputs, not results: the source explains its measurements by a transom at "
            "45 deg and by specular struts. "
            * starred
            + "Heights are of single 1 m bins. `source`: its statements on the synthetic and the "
            "measured ship.",
            console,
        )


def put_in(flights: xr.Dataset, **gains: float) -> xr.Dataset:
    """Return the flight of nominal inputs except some gains, all draws and sources of profiles."""
    return nominal(flights, keep=KEPT, **gains)


def ships_with_masts(near: xr.Dataset) -> list[str]:
    """Return ships of near-stern flights with all landmarks, including masts and bridge."""
    there = np.isfinite(near.mast_position.sel(source="noiseless"))
    over = [dim for dim in there.dims if dim != "ship"]
    return [name for name in near.ship.values.tolist() if there.any(over).sel(ship=name)]


def print_sensitivity(flights: xr.Dataset, console: Console) -> None:
    """Print the effect of each wrong flight parameter, with and without autofocus."""
    focused = flights.sizes.get("autofocus", 1) > 1
    headings = ("correlation", *(("with autofocus", "closing speed then") if focused else ()))
    for axes, flight in _flights(flights, but=INSIDE):
        table = sheet(
            f"Simulated flights, wrong parameters: {shown(axes['ship'])}, "
            f"aspect {axes['aspect_deg']:g} deg, "
            f"{axes['range_km']:g} km{which(flight, flights, but=(*TITLED, *INSIDE))}",
            *("error", *headings),
            left=("parameter",),
        )
        for k in range(flight.sizes["error"]):
            one = flight.isel(error=k)
            row = [_mean((one.sel(autofocus=False) if focused else one).profile_correlation, 3)]
            if focused:
                after = one.sel(autofocus=True)
                row.append(_mean(after.profile_correlation, 3))
                row.append(_mean(100 * after.closing_speed_error, 2, "%"))
            amount = f"{one.error_value.item():g}"
            table.add_row(shown(one.error_parameter.item()), amount, *row)
        show(table, console)
    note(
        "Correlation of the simulated flight's profile with the noiseless one, mean over draws "
        "with the standard deviation of one. Errors of the aircraft's speed in percent, of the "
        "ship's in m/s, of headings and pointing in deg; all other parameters are exact.",
        console,
    )


def _flights(flights: xr.Dataset, *, but: Iterable[str] = ()) -> Iterator[tuple[Row, xr.Dataset]]:
    """Yield each flight with its place on the axes, all draws together."""
    axes = axes_of(flights.looks)
    dims = [dim for dim in dict.fromkeys(axes.values()) if dim and dim not in but]
    for place in np.ndindex(*(flights.sizes[dim] for dim in dims)):
        one = flights.isel(dict(zip(dims, place, strict=True)))
        if not np.isnan(one.looks).all():
            here = {axis: one[axis.name] for axis in axes}
            yield {axis: value.item() for axis, value in here.items() if not value.dims}, one


def _mean(values: xr.DataArray, digits: int, unit: str = "") -> str:
    """Return a mean over draws and the standard deviation of one."""
    found = np.asarray(values, dtype=float).ravel()
    found = found[np.isfinite(found)]
    if not found.size:
        return NOTHING
    text = f"{round(found.mean(), digits) + 0.0:.{digits}f}{unit}"
    scatter = found.std(ddof=1) if found.size > 1 else 0.0
    return f"{text} ±{scatter:.{digits}f}".replace("±0.", "±.") if scatter > 0 else text


def measured_rows(tables: xr.Dataset) -> list[Row]:
    """Return percent correct of simulated flights' profiles beside synthetic ones, all draws.

    `ship_` scores the ship alone, if a classifier predicts an aspect bin, too.
    """
    rows = score_rows(tables)
    for row, ship in zip(rows, score_rows(tables, "ship_"), strict=True):
        count = row.pop("n")
        row |= {f"ship_{name}": ship[name] for name in ("percent_correct", *ENDS)} | {"n": count}
    return rows


def print_measured(rows: list[Row], console: Console) -> None:
    """Print percent correct of profiles of simulated flights beside synthetic ones.

    One row for every value of an axis, or a single one if all give the same.
    """
    bins = list(dict.fromkeys(row[BIN] for row in rows))
    axes = [
        axis
        for axis in several(rows, but=(*NAMED, BIN), none=True)
        if axis.name != "error_value" and not axis.number
    ]
    table = sheet(
        "Ships in simulated flights identified correctly [%] after training on synthetic profiles",
        *bins,
        left=(
            *("pulse [ns]", "classifier"),
            *("error" if axis.name == "error_parameter" else axis.heading for axis in axes),
            "profiles",
        ),
    )
    for (pulse, name, kind), group in grouped(rows, NAMED).items():
        lines: dict[tuple[str, ...], dict[str, str]] = {}
        for row in group:
            of_ship = {name[5:]: figure for name, figure in row.items() if name[:5] == "ship_"}
            setting = tuple(_setting(row, axis) for axis in axes)
            lines.setdefault(setting, {})[row[BIN]] = percent_text(of_ship)
        figures = list(lines.values())
        if len(figures) > 1 and all(line == figures[0] for line in figures):
            lines = {("all",) * len(axes): figures[0]}
        word = str(name).upper() if len(str(name)) == 3 else shown(name)
        for setting, line in lines.items():
            texts = (line.get(label, "") for label in bins)
            table.add_row(shown(pulse), word, *setting, shown(kind), *texts)
    show(table, console)
    if any(axis.name in SHORT for axis in axes):
        note(PUT_IN, console)
    note(
        "Of the ships flown past, scored by ship, over all draws of the noise, with 95 % "
        "intervals. learned: the synthetic profiles themselves, without noise; test: averages of "
        "their frames, with the range profiler's noise; measured: corrected images of simulated "
        "flights, gathered into its beams, with the noise of the flight only.",
        console,
    )


def _setting(row: Row, axis: Axis) -> str:
    return told(row, [axis])[0] if axis.name == "error_parameter" else shown(row[axis])
