"""Pictures of flights: every stage of their corrections, simulated again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import label as connected

import ncti.ships
from ncti import irar
from ncti.irar import Chain, Scan, Snapshot
from ncti.irar.corrected import EXACT, RATES
from sweeps.report.stores import nominal
from sweeps.stages.irar import FLOWN, RECORDED, scan_again, surface
from sweeps.stages.ships import ship_name
from sweeps.stages.views import hull, read_mesh

if TYPE_CHECKING:
    import trimesh

STRIPES = 12.0  # m of range in one cycle of the colours, as in the source's images
MARGIN = 12  # pixels around the ship in corrected images
BRIGHTEST = 99.0  # percentile of the ship's pixels at the end of the scale
# Colours of pixels without a sample, and of sampled pixels without a range.
NO_LOOK, NO_RANGE = "#44566b", "0.62"
UNSEEN = "slate blue: no sample; black, or grey in range images: sampled, no ship"

SHIFTS = {"pixel": "", "line": " by line", "constant": " by one constant"}
TURNS = {"exact": "sheared", "printed": "sheared by the printed angle", "rotation": "turned"}

SMALL, LABEL, TITLE = 8.5, 9.5, 12.0  # points
NARROW = 24  # letters of a title over a narrow panel


@dataclass(frozen=True, eq=False)
class Stage:
    """Images after some of the corrections: (row, column) arrays.

    Intensity in noise powers, range [m] from the ship's origin, infrared [K]; no sample fell into
    unseen pixels. The extent is left, right, bottom and top [pixel or line].
    """

    title: str
    intensity: NDArray[np.floating]
    range: NDArray[np.floating]
    infrared: NDArray[np.floating]
    unseen: NDArray[np.bool_]
    extent: tuple[float, float, float, float]
    square: bool = True


def flights_of(flights: xr.Dataset) -> dict[str, xr.Dataset]:
    """Return every flight of `validation`, by ship (slowest), range and aspect, with its title.

    Its first draw, at the preferred value of all other axes.
    """
    seen = np.isfinite(flights.looks)
    flown = np.atleast_1d(seen.any([dim for dim in seen.dims if dim != "ship"]).values)
    others = set(map(str, flights.looks.dims)) - {"ship", "aspect", "range", "replicate"}
    draws, titled = flights.sizes.get("replicate", 1), {}
    places = (np.atleast_1d(flights[name].values) for name in ("range", "aspect"))
    for ship, *at in product(np.atleast_1d(flights.ship.values)[flown], *places):
        here = flights.sel(ship=ship, range=at[0], aspect=at[1])
        flight = nominal(here, keep=("source", "kind", "pulse_width"))
        title = f"{ship} at {at[0]:g} km, aspect {at[1]:g}°, simulated"
        for axis in sorted(others):
            if flights.sizes[axis] > 1 and axis in flight.looks.coords:
                title += f", {axis.replace('_', ' ')} {flight[axis].item()}"
        titled[title + f", first of {draws} draws" * (draws > 1)] = flight
    return titled


def _setting(dataset: xr.Dataset, configuration: Mapping[str, Any], name: str) -> Any:
    """Return a setting: the coordinate of that name, else the configuration's value; or None."""
    if name in dataset.coords and not dataset[name].dims:
        value = dataset[name].item()
        return None if value != value else value
    value = configuration[name]
    return value[0] if isinstance(value, list) else value


def scan_of(
    attributes: Mapping[str, Any], flight: xr.Dataset, mesh: trimesh.Trimesh
) -> dict[str, Any]:
    """Return noisy raw images of one flight of a store, and its corrections: see `stages`."""
    given = attributes["configuration"]
    reflectance = _setting(flight, given["ladar"], "reflectance")
    values = {setting.name: _setting(flight, {}, setting.name) for setting in (*FLOWN, *RECORDED)}
    place = {"ship": flight.ship.item(), "aspect": flight.aspect.item()}
    place["seed"] = _setting(flight, given, "seed")
    methods = {name: flight[name].item() for name in ("chain", "azimuth", "mirror", "range_filter")}
    threshold = _setting(flight, given["irar"], "segmentation_threshold")
    return {
        "scan": scan_again(values, mesh, **place, reflectance=reflectance),
        "chain": Chain(**methods, segmentation_threshold=threshold),
        "autofocus": flight.autofocus.item(),
        **surface(mesh, values, reflectance),
    }


def known_ship(attributes: Mapping[str, Any], label: str) -> trimesh.Trimesh:
    """Return the known ship of a name. Raises ValueError if the store was made with another."""
    if label not in ncti.ships.names():
        raise ValueError(
            f"{label} was read from a file that the store does not name, but ships drawn must be "
            f"among {', '.join(ncti.ships.names())}"
        )
    known = hull.function(ship_name(label))
    if known.digest != attributes["mesh_digests"][label]:
        raise ValueError(f"{label} has changed since the store was made")
    return read_mesh(known)


def stages(
    mesh: trimesh.Trimesh,
    scan: Scan,
    chain: Chain | None = None,
    *,
    autofocus: bool = False,
    **surface: Any,
) -> list[Stage]:
    """Return every stage of a chain, as in the source's Figures 10, 11 and 13.

    Stages that are switched off are left out; the source's own chain is one stage. The surface is
    as of `ncti.irar.true_snapshot`.
    """
    chain = chain or Chain()
    estimate, (lines, samples) = scan.flight, scan.intensity.shape
    if autofocus:
        with suppress(ValueError):  # no ship in the image
            estimate = irar.autofocus(scan, scan.flight)
    overscanned = Stage(
        "overscanned",
        scan.intensity,
        scan.range - scan.flight.slant_range,
        irar.time_delay_integrate(scan.infrared),
        np.zeros(scan.intensity.shape, dtype=bool),
        (0, samples, 0, lines),
        square=False,
    )
    window = irar.ship_window(mesh, scan.flight, margin=MARGIN)
    truth = irar.true_snapshot(mesh, scan.flight, window, **surface)
    images = [overscanned]
    for title, part in _parts(chain).items():
        image = part.correct(scan, estimate)
        ship = irar.segmented(image, estimate, threshold=chain.segmentation_threshold)
        last = ": all corrections" if part == chain and chain.chain == EXACT else ""
        images.append(_stage(title + last, ship, estimate.slant_range))
    return [*images, _stage("truth, noiseless", truth, scan.flight.slant_range)]


def _parts(whole: Chain) -> dict[str, Chain]:
    """Return the chain up to each of its corrections, by title."""
    if whole.chain != EXACT:
        return {f"all corrections as printed,\nf the {RATES[whole.chain]} rate": whole}
    combined = "" if whole.range_filter == Chain.range_filter else f" by {whole.range_filter}"
    averaged = f"averaged, range corrected{combined}, segmented"
    parts = {averaged: replace(whole, azimuth="none", mirror="none")}
    if whole.azimuth != "none":
        parts[f"shifted in azimuth{SHIFTS[whole.azimuth]}"] = replace(whole, mirror="none")
    if whole.mirror != "none":
        parts[TURNS[whole.mirror]] = whole
    return parts


def _stage(title: str, image: Snapshot, slant_range: float) -> Stage:
    """Return a stage, cropped to its ship: the largest bright or warm region."""
    warm = np.nan_to_num(image.infrared)
    bright = (np.nan_to_num(image.intensity) > 0) | (warm > warm.max() / 4)
    pieces, count = connected(bright, structure=np.ones((3, 3)))
    largest = 1 + np.bincount(pieces.ravel(), minlength=2)[1:].argmax()
    seen = pieces == largest if count else np.ones(bright.shape, dtype=bool)
    part = tuple(
        slice(max(0, lit[0] - MARGIN // 2), lit[-1] + 1 + MARGIN // 2)
        for lit in (np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0))
    )
    row, column = image.row[part[0]], image.column[part[1]]
    return Stage(
        title,
        image.intensity[part],
        image.range[part] - slant_range,
        image.infrared[part],
        image.looks[part] == 0,
        (column[0] - 0.5, column[-1] + 0.5, row[0] - 0.5, row[-1] + 0.5),
    )


def draw_stages(every: Sequence[Stage], title: str) -> Figure:
    """Draw the images of stages of a chain, each kind of corrected image on one scale."""
    left, right, bottom, top = every[-1].extent
    wide = right - left > 1.5 * (top - bottom)
    # A ship seen from abeam is wide: its stages are drawn below one another.
    size = (11.0, 1.85 * len(every)) if wide else (2.6 * len(every), 8.0)
    figure = Figure(figsize=size, dpi=150, layout="constrained")
    panels = figure.subplots(*((len(every), 3) if wide else (3, len(every))), squeeze=False)
    top_intensity = brightest([stage.intensity for stage in every[1:]])
    warmth = np.concatenate([stage.infrared[~stage.unseen] for stage in every[1:-1]])
    ends = np.percentile(warmth, (100 - BRIGHTEST, BRIGHTEST)) if warmth.size else (0, 1)
    for row, stage in zip(panels if wide else panels.T, every, strict=True):
        warm: tuple[str, Any, str] = ("infrared [K]", ends, "both")
        if stage is every[0]:
            warm = (warm[0], (None, None), "neither")
        elif stage is every[-1]:
            warm = ("share of ship", (0, 1), "neither")
        lit = ("intensity / noise", (0, top_intensity), "max")
        far = (f"range mod {STRIPES:g} m", (0, STRIPES), "neither")
        images = (stage.intensity, np.mod(stage.range, STRIPES), stage.infrared)
        kinds = zip(row, images, ("gray", "twilight", "inferno"), (lit, far, warm), strict=True)
        for axes, values, colours, (label, (low, high), extend) in kinds:
            image = _show(axes, stage, values, colours, low=low, high=high)
            # All stages but the raw one have the same pixels: one label at each end is enough.
            if stage in (every[0], every[-1]) or not wide:
                axes.set_xlabel("column [pixel]" if stage.square else "sample", fontsize=SMALL)
            if axes is row[0] or not wide:
                axes.set_ylabel("row [pixel]" if stage.square else "line", fontsize=SMALL)
            bar = figure.colorbar(image, ax=axes, shrink=0.9, pad=0.02, extend=extend)
            bar.set_label(label, fontsize=SMALL)
            bar.ax.tick_params(labelsize=SMALL - 1)
        heading = stage.title if wide else fill(stage.title, NARROW)
        row[0].set_title(heading, fontsize=SMALL, loc="left")
    figure.suptitle(title, fontsize=TITLE)
    if any(stage.unseen.any() for stage in every):
        figure.supxlabel(UNSEEN, fontsize=LABEL, color="0.3")
    return figure


def brightest(images: Sequence[NDArray[np.floating]]) -> float:
    """Return the upper end of a common scale of images; 1 if all are dark."""
    lit = (image[np.nan_to_num(image) > 0] for image in images)
    return max((float(np.percentile(part, BRIGHTEST)) for part in lit if part.size), default=1.0)


def _show(
    axes: Axes, stage: Stage, values: NDArray[np.floating], colours: str, *, low: Any, high: Any
) -> Any:
    where: dict[str, Any] = {"origin": "lower", "extent": stage.extent, "interpolation": "nearest"}
    where["aspect"] = "equal" if stage.square else "auto"
    axes.set_facecolor(NO_RANGE)
    image = axes.imshow(values, cmap=colours, vmin=low, vmax=high, **where)
    if stage.unseen.any():
        nothing = np.ma.masked_where(~stage.unseen, stage.unseen)
        axes.imshow(nothing, cmap=ListedColormap([NO_LOOK]), **where)
    axes.tick_params(labelsize=SMALL)
    return image
