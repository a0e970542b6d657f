"""Pictures of flights: every stage of their corrections, simulated again."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import ncti.ships
from ncti import irar
from ncti.checks import NothingSeenError
from ncti.irar import Chain, Scan, Snapshot, Window
from ncti.irar.corrected import EXACT, NO_ERROR, RATES
from sweeps.report.stores import select_preferred
from sweeps.stages.irar import FLOWN, RECORDED, scan_again, surface
from sweeps.stages.meshes import mesh_source, read_mesh
from sweeps.stages.ships import ship_name

if TYPE_CHECKING:
    import trimesh

FONT_SIZE = 8.5  # points
STRIPE_WIDTH = 12.0  # m of range in one cycle of the colours, as in the article's images
TOP_PERCENTILE = 99.5  # percentile of an image at the end of its scale
KINDS = {
    "intensity / noise": "gray",
    f"range mod {STRIPE_WIDTH:g} m": "twilight",
    "infrared [K]": "inferno",  # of the truth, the share of ship
}
AZIMUTH_TEXTS = {"pixel": "", "line": " by line", "constant": " by one constant"}
MIRROR_TEXTS = {"exact": "sheared", "printed": "sheared by the printed angle", "rotation": "turned"}
VIEW = ("range", "aspect")
RAW, TRUTH = "overscanned", "truth, noiseless"


def flights_of(flights: xr.Dataset) -> dict[str, xr.Dataset]:
    """Return the flights of `validation` by title, in order of ship (slowest), range and aspect.

    Each is the first draw, at the preferred value of all other axes.
    """
    dims = [str(dim) for dim in flights.looks.dims if dim != "ship"]
    flown = flights.ship.values[flights.looks.notnull().any(dims)]
    swept = [dim for dim in dims if dim not in VIEW and flights.sizes[dim] > 1]
    flights_by_title = {}
    for ship, *view in product(flown, *(flights[name].values for name in VIEW)):
        flown_view = flights.sel(dict(zip(("ship", *VIEW), (ship, *view), strict=True)))
        flight = select_preferred(flown_view, keep=("source", "kind", "pulse_width"))
        words = [f"{ship} at {view[0]:g} km", f"aspect {view[1]:g}°", "simulated"]
        words += [
            f"{dim.replace('_', ' ')} {flight[dim].item()}" for dim in swept if dim in flight.coords
        ]
        flights_by_title[", ".join(words)] = flight
    return flights_by_title


def _read_setting(dataset: xr.Dataset, configuration: Mapping[str, Any], name: str) -> Any:
    """Return a setting: the coordinate of that name, else the configuration's value; or None."""
    if name in dataset.coords and not dataset[name].dims:
        value = dataset[name].item()
        return None if value != value else value
    value = configuration[name]
    return value[0] if isinstance(value, list) else value


def scan_of(
    attributes: Mapping[str, Any], flight: xr.Dataset, mesh: trimesh.Trimesh
) -> dict[str, Any]:
    """Simulate the noisy raw images of a stored flight again.

    Returns the keyword arguments of `correction_stages`: the scan, its corrections and the surface.
    """
    configuration = attributes["configuration"]
    reflectance = _read_setting(flight, configuration["ladar"], "reflectance")
    values = {
        setting.name: _read_setting(flight, {}, setting.name) for setting in (*FLOWN, *RECORDED)
    }
    view = {"ship": flight.ship.item(), "aspect": flight.aspect.item()}
    view["seed"] = _read_setting(flight, configuration, "seed")
    methods = {name: flight[name].item() for name in ("azimuth", "mirror", "range_filter")}
    threshold = _read_setting(flight, configuration["irar"], "segmentation_threshold")
    return {
        "scan": scan_again(values, mesh, **view, reflectance=reflectance),
        "chain": Chain(form=flight.chain.item(), **methods, segmentation_threshold=threshold),
        "autofocus": flight.autofocus.item(),
        **surface(mesh, values, reflectance),
    }


def known_ship(attributes: Mapping[str, Any], label: str) -> trimesh.Trimesh:
    """Return the mesh of a known ship; raise ValueError if the store was made with another mesh."""
    if label not in ncti.ships.names():
        raise ValueError(
            f"{label} was read from a file that the store does not name, but ships drawn must be "
            f"among {', '.join(ncti.ships.names())}"
        )
    packaged_ship = mesh_source(ship_name(label))
    if packaged_ship.digest != attributes["mesh_digests"][label]:
        raise ValueError(f"{label} has changed since the store was made")
    return read_mesh(packaged_ship)


def correction_stages(
    mesh: trimesh.Trimesh, scan: Scan, chain: Chain, *, autofocus: bool = False, **surface: Any
) -> dict[str, Snapshot]:
    """Return the raw images, those after every stage of a chain, and the truth, by title.

    As in the article's Figures 10, 11 and 13. Stages that are switched off are left out; the
    article's own chain is one stage. The surface is as of `ncti.irar.true_snapshot`.
    """
    flight, (lines, samples) = scan.flight, scan.intensity.shape
    estimate = flight
    if autofocus:
        with suppress(NothingSeenError):  # no ship in the image
            estimate = irar.autofocus(scan, flight)
    raw = Snapshot(
        window=Window(bottom=0, left=0, rows=lines, columns=samples),
        row=np.arange(lines, dtype=float),
        column=np.arange(samples, dtype=float),
        intensity=scan.intensity.astype(np.float64),
        range=scan.range,
        infrared=irar.time_delay_integrate(scan.infrared),
        looks=np.ones(scan.intensity.shape, dtype=int),
    )
    images = {RAW: raw}
    for title, part in _partial_chains(chain).items():
        image = part.correct(scan, estimate, part.window(mesh, flight, NO_ERROR))
        threshold = chain.segmentation_threshold
        images[title] = irar.segmented(image, estimate, threshold=threshold)
    truth = irar.true_snapshot(mesh, flight, irar.ship_window(mesh, flight), **surface)
    return images | {TRUTH: truth}


def _partial_chains(chain: Chain) -> dict[str, Chain]:
    """Return the chain up to each of its corrections, by title."""
    if chain.form != EXACT:
        return {f"all corrections as printed,\nf the {RATES[chain.form]} rate": chain}
    combined = "" if chain.range_filter == Chain.range_filter else f" by {chain.range_filter}"
    averaged = f"averaged, range corrected{combined}, segmented"
    parts = {averaged: replace(chain, azimuth="none", mirror="none")}
    if chain.azimuth != "none":
        parts[f"shifted in azimuth{AZIMUTH_TEXTS[chain.azimuth]}"] = replace(chain, mirror="none")
    if chain.mirror != "none":
        parts[MIRROR_TEXTS[chain.mirror]] = chain
    *_, last = parts
    return {title + ": all corrections" * (title == last): part for title, part in parts.items()}


def draw_stages(images: Mapping[str, Snapshot], title: str, slant_range: float) -> Figure:
    """Draw the images of stages of a chain, seen from a slant range [m]."""
    figure = Figure(figsize=(11.0, 1.9 * len(images)), dpi=150, layout="constrained")
    panels = figure.subplots(len(images), len(KINDS), squeeze=False)
    for row, (name, image) in zip(panels, images.items(), strict=True):
        extent = (*image.column[[0, -1]], *image.row[[0, -1]])
        style: dict[str, Any] = {"origin": "lower", "extent": extent, "interpolation": "nearest"}
        style["aspect"] = "auto" if name == RAW else "equal"
        layers = (image.intensity, np.mod(image.range - slant_range, STRIPE_WIDTH), image.infrared)
        for axes, values, (label, colours) in zip(row, layers, KINDS.items(), strict=True):
            finite = values[np.isfinite(values)]
            top = np.percentile(finite, TOP_PERCENTILE) if finite.size else None
            drawn = axes.imshow(values, colours, vmax=top, **style)
            figure.colorbar(drawn, ax=axes, label=label)
        row[0].set_title(name, loc="left", fontsize=FONT_SIZE)
    figure.suptitle(title)
    return figure
