"""Tables of simulated flights, from sweeps of several draws of the noise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.reports import Column, Report
from docs._tables.repeated import list_argument, mean_over_seeds, pick

FLIGHT = ("sensor=irar", "grid.aspect=175")
NEAR_STERN = ("+experiment=validation", "irar.pictures=false")
MEASURED_SHIPS = ("connole", "roberts")
MISSIONS = {"connole": 3, "roberts": 3.9, "duncan": 4}  # slant ranges [km], as in the experiment
CLUTTERS = (0, 0.3, 1)  # of the sea [K]
CHAINS = ("+experiment=corrections",)
ERRORS = {  # of navigation, that the table has; units are below
    "aircraft_speed": (-5, -2, -1, 1, 2, 5),
    "ship_speed": (-2, 2),
    "aircraft_heading": (-5, 5),
    "ship_heading": (-10, 10),
    "pointing": (-1, 1),
}
UNITS = {"aircraft_speed": " %", "ship_speed": " m/s"}  # of errors; others are degrees
NAVIGATION_ERRORS = tuple((name, value) for name, values in ERRORS.items() for value in values)
SENSITIVITY = (
    "+experiment=sensitivity",
    *(f"irar.errors.{name}={list_argument(values)}" for name, values in ERRORS.items()),
)

MEASURED = ("+experiment=measured", "grid.pulse_width=30")
LEARNERS = {"acn": "ACN", "mnn": "MNN", "correlation": "correlation"}
KINDS = {
    "learned": "synthetic, as learned",
    "measured": "of simulated flights",
    "test": "synthetic averages of 16 frames",
}

ASSUMED = {  # inputs taken from the article's explanation, by what is assumed
    "nothing": {"transom_gain": 1.0, "mast_gain": 1.0},
    "dark transoms*": {"transom_gain": 0.0, "mast_gain": 1.0},
    "masts x 3*": {"transom_gain": 1.0, "mast_gain": 3.0},
    "both*": {"transom_gain": 0.0, "mast_gain": 3.0},
}


def text_of(draws: xr.DataArray, digits: int, bounds: tuple[float, float]) -> str:
    """Return the mean of a figure over draws, with its interval if they differ."""
    values = draws.transpose("replicate", ...).values.reshape(draws.sizes["replicate"], -1)
    of_draw = values.mean(axis=1)
    if np.ptp(of_draw) == 0:
        return f"{of_draw[0]:.{digits}f}"
    return mean_over_seeds(of_draw, bounds=bounds).text(digits)


def join_flights(flights: Mapping[str, xr.Dataset], name: str, **places: float) -> xr.DataArray:
    """Return a figure of all ships, (ship, replicate)."""
    figures = [pick(flight[name], **places).squeeze(drop=True) for flight in flights.values()]
    return xr.concat(figures, "ship")


def mean_heading(draws: int) -> str:
    """Return the heading of a first column."""
    return f"mean of {draws} draws [95 % interval]"


def near_stern(flights: Mapping[str, xr.Dataset]) -> dict[str, Report]:
    """Return landmarks of near-stern profiles, and the likeness of all to noiseless profiles."""
    no_assumption = ASSUMED["nothing"]
    duncan, roberts = pick(flights["duncan"], **no_assumption), flights["roberts"]
    columns = {
        "Duncan synthetic, point sampled": duncan.sel(source="point"),
        "the same, spread": duncan.sel(source="synthetic"),
        "Roberts flown past": pick(roberts, **no_assumption, source="measured"),
        "with a dark transom*": pick(roberts, **ASSUMED["dark transoms*"], source="measured"),
        "with masts x 3*": pick(roberts, **ASSUMED["masts x 3*"], source="measured"),
    }
    rows: list[dict[str, Any]] = []
    for label, name, digits, words in (
        ("stern to hangar [m]", "stern_to_hangar", 1, "same"),
        ("transom over hangar", "transom_ratio", 2, "large, none"),
        ("spikes of the flight deck", "deck_spikes", 1, "three, none"),
        ("main mast past hangar [m]", "mast_position", 1, "same"),
        ("main mast over hangar", "mast_ratio", 2, "less, more"),
    ):
        row = {"what": label, "said": words}
        for key, flights_of in columns.items():
            row[key] = text_of(flights_of[name], digits, (0, np.inf))
        rows.append(row)
    draws = roberts.sizes["replicate"]
    likeness = []
    for label, gains in ASSUMED.items():
        row = {"what": label}
        for key in ("profile_correlation", "profile_correlation_without_hangar"):
            together = join_flights(flights, key, **gains)
            row[key] = f"{text_of(together, 3, (-1, 1))}; {float(together.min()):.3f}"
        likeness.append(row)
    passes = f"{len(flights)} x {draws} flights"
    return {
        "near_stern": Report(
            "Near-stern profiles of simulated flights",
            (
                Column("what", mean_heading(draws)),
                *(Column(key, key) for key in columns),
                Column("said", "article's words"),
            ),
            rows,
        ),
        "likeness": Report(
            "Correlation of profiles of simulated flights with noiseless ones",
            (
                Column("what", f"assumed; {mean_heading(draws)}; least of {passes}"),
                Column("profile_correlation", "correlation"),
                Column("profile_correlation_without_hangar", "without the hangar's peak"),
            ),
            likeness,
        ),
    }


def tilts(flights: Mapping[str, xr.Dataset]) -> dict[str, Report]:
    """Return the remaining tilts of corrected images, by fitted images and clutter."""
    draws = next(iter(flights.values())).sizes["replicate"]

    def format_tilt(name: str, clutter: float) -> str:
        """Return the root mean square of each draw, and the largest of all flights."""
        tilt = join_flights(flights, name, clutter=clutter)
        rms = (tilt**2).mean("ship") ** 0.5
        return f"{text_of(rms, 2, (0, np.inf))}; {float(abs(tilt).max()):.2f}"

    channels = {"": "both images", "intensity_": "intensity alone"}
    columns = {
        f"{channel}{mark}_tilt": f"{mark}, {words}"
        for mark in ("mast", "waterline")
        for channel, words in channels.items()
    }
    rows = [
        {"what": f"clutter of {clutter:g} K"}
        | {name: format_tilt(name, clutter) for name in columns}
        for clutter in CLUTTERS
    ]
    rows[0]["what"] = "calm sea"
    still = {"what": "no noise"}
    for mark in ("mast", "waterline"):
        still[f"{mark}_tilt"] = format_tilt(f"noiseless_{mark}_tilt", 0)
    title = (
        f"root mean square tilt [°], {mean_heading(draws)}; "
        f"largest of {len(flights) * draws} flights"
    )
    return {
        "tilts": Report(
            "Tilts left in images of simulated flights",
            (Column("what", title), *(Column(name, words) for name, words in columns.items())),
            [*rows, still],
        )
    }


def chains(flights: xr.Dataset) -> dict[str, Report]:
    """Return the cost of the chain of corrections printed in the article."""
    rows = []
    for label, chain in (
        ("exact", "exact"),
        ("as printed, f the line rate", "printed"),
        ("as printed, f the pulse rate", "printed_pulse_rate"),
    ):
        chain_flights = flights.sel(chain=chain).squeeze(drop=True)
        rows.append(
            {
                "what": label,
                "correlation": text_of(chain_flights.profile_correlation, 3, (-1, 1)),
                "tilt": text_of(abs(chain_flights.mast_tilt), 1, (0, 90)),
            }
        )
    return {
        "chains": Report(
            "Chains of corrections",
            (
                Column("what", f"chain; {mean_heading(flights.sizes['replicate'])}"),
                Column("correlation", "correlation with the noiseless profile"),
                Column("tilt", "masts lean by [°]"),
            ),
            rows,
        )
    }


def sensitivity(flights: xr.Dataset) -> dict[str, Report]:
    """Return correlations with the noiseless profile by error of a flight parameter."""
    flights = flights.squeeze(drop=True)
    pairs = list(zip(flights.error_parameter.values, flights.error_value.values, strict=True))
    rows = []
    for name, value in (("none", 0.0), *NAVIGATION_ERRORS):
        correlation = flights.profile_correlation.isel(error=pairs.index((name, value)))
        error = f"{name.replace('_', ' ')} {value:+g}{UNITS.get(name, '°')}"
        row = {"what": error if value else "none"}
        for key, focused in (("plain", False), ("focused", True)):
            row[key] = text_of(correlation.sel(autofocus=focused), 2, (-1, 1))
        rows.append(row)
    return {
        "sensitivity": Report(
            "Errors of navigation",
            (
                Column("what", f"error; {mean_heading(flights.sizes['replicate'])}"),
                Column("plain", "correlation"),
                Column("focused", "with autofocus"),
            ),
            rows,
        )
    }


def measured_accuracy(answers: xr.Dataset) -> dict[str, Report]:
    """Return percent correct for profiles of simulated flights, beside synthetic ones."""
    answers = answers.squeeze(drop=True)
    draws = answers.sizes["replicate"]
    # Ships that were not flown past have no answers of flights.
    flown = (answers.ship_correct.sel(kind="measured") >= 0).any(["replicate", "aspect"])
    correct = answers.ship_correct.where(answers.ship_correct >= 0)
    shares = 100 * correct.isel(ship=flown.all("classifier").values).mean(["ship", "aspect"])
    rows = [
        {"kind": words}
        | {name: text_of(shares.sel(kind=kind, classifier=name), 0, (0, 100)) for name in LEARNERS}
        for kind, words in KINDS.items()
    ]
    title = f"percent correct at 30 ns, {mean_heading(draws)}"
    return {
        "measured": Report(
            "Profiles of simulated flights, identified after synthetic training",
            (Column("kind", title), *(Column(name, words) for name, words in LEARNERS.items())),
            rows,
        )
    }
