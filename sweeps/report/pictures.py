"""Pictures of a store: its ships, range profiles, infrared images, and flights' corrections."""

from __future__ import annotations

import base64
import io
import re
import warnings
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from ncti.text import printable
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import PathOrUrl
from sweeps.report.confusion import most_confused
from sweeps.report.outputs import tables_folder, write_own_files
from sweeps.report.screen import buffered_console, print_line
from sweeps.report.stores import (
    attributes,
    error_reason,
    list_groups,
    open_store,
    read_group,
    select_preferred,
)
from sweeps.report.words import unit_of

if TYPE_CHECKING:
    import trimesh
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FONT_SIZE = 8.5  # points
PROFILE_ASPECT, BOW_TO_BEAM = 30.0, (0.0, 30.0, 60.0, 90.0)  # deg, of the article's Figures 3 to 5
IMAGE_ASPECT = 60.0  # deg, of its Figures 6 to 8
SCALE_BAR = 50.0  # m, drawn below its images
LINE_SPACING = 1.15  # between lines above one another
DPI = 100  # of pictures of the page
SHIPS, CONFUSED = "ships", "classification"  # groups
Floats = NDArray[np.float64]

DIMENSIONS = ("length", "beam", "height", "facets")
SHIP_COLOURS = ("#34485c", "#b2cade")
"""Of ships, visible on light and dark pages."""


def draw_profiles(store: PathOrUrl) -> Figure:
    """Draw range profiles: one ship from bow to beam, all ships at one aspect, and averages."""
    from matplotlib.figure import Figure

    profiles = read_group(open_store(store), "range_profile")[["expected", "averaged"]]
    dims = ("ship", "aspect", "frame_count", "down_range")
    profiles = select_preferred(profiles, keep=dims)
    oblique = profiles.sel(aspect=PROFILE_ASPECT, method="nearest").load()  # loads only this aspect
    ship, angle = profiles.ship.values[0], f"{float(oblique.aspect):g}°"
    ship_profiles = profiles.expected.sel(ship=ship)
    bow_to_beam = ship_profiles.sel(aspect=list(BOW_TO_BEAM), method="nearest")
    bow_to_beam = bow_to_beam.drop_duplicates("aspect").load()
    averaged = oblique.averaged.sel(ship=ship)
    figure = Figure(figsize=(11.0, 4.6), dpi=150)
    # Fixed margins, since a layout engine takes as long as drawing.
    figure.subplots_adjust(left=0.01, right=0.99, bottom=0.11, top=0.86, wspace=0.04)
    panels = figure.subplots(1, 3)
    _draw_stack(panels[0], bow_to_beam, "aspect", "{:g}°", f"{ship}, bow (0°) to beam (90°)")
    _draw_stack(panels[1], oblique.expected, "ship", "{}", f"ships at {angle}")
    _draw_stack(panels[2], averaged, "frame_count", "{} frames", f"{ship} at {angle}, averages")
    setting = f"{profiles.range.item():g} km, {profiles.pulse_width.item():g} ns pulses"
    figure.suptitle(f"Range profiles at {setting}")
    return figure


def _draw_stack(axes: Axes, profiles: xr.DataArray, over: str, label: str, title: str) -> None:
    """Draw stacked profiles, each scaled from its noise floor to its peak."""
    for index, value in enumerate(np.atleast_1d(profiles[over].values).tolist()):
        profile = profiles.sel({over: value}) if profiles[over].ndim else profiles
        floor = profile.quantile(0.2).item()
        extent = (profile.max().item() - floor) or 1.0
        height = (profile.values - floor) / extent - LINE_SPACING * index
        axes.plot(profile.down_range, height, lw=1.1)
        anchor = profile.down_range[-1].item(), 0.15 - LINE_SPACING * index
        behind = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
        words = printable(label.format(value))
        # Noise may cross it.
        axes.annotate(words, anchor, ha="right", fontsize=FONT_SIZE, bbox=behind)
    axes.set(title=printable(title), yticks=[], xlabel="down-range from the ship origin [m]")
    axes.spines[["left", "right", "top"]].set_visible(False)


def draw_silhouettes(store: PathOrUrl) -> Figure:
    """Draw infrared images and log-polar maps of a ship by range and super-resolution."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    images = read_group(open_store(store), "infrared")
    dims = ("ship", "aspect", "range", "super_resolution", "row", "col", "angle", "radius")
    view = select_preferred(images, keep=dims).sel(aspect=IMAGE_ASPECT, method="nearest")
    ship = "spruance" if "spruance" in view.ship.values else view.ship.values[0]
    view = view.sel(ship=ship)[["image", "log_polar"]].load()
    ranges, ways = view.range.values, view.super_resolution.values
    panels = [
        [_image_and_map(view.sel(range=r, super_resolution=way)) for way in ways] for r in ranges
    ]
    # Crop all images to the smallest, on one scale, so that the ship has one length in all.
    extents = np.array([extent for row in panels for _, extent, _ in row])
    (left, low), (right, high) = extents[:, ::2].max(axis=0), extents[:, 1::2].min(axis=0)
    width, height, gap = right - left, high - low, 0.04 * (right - left)
    tall, margin = 1.5 * height, 3 * gap  # with the map, which is below the image
    size = np.array([len(ways) * (width + gap) + margin, len(ranges) * (tall + gap) + margin])
    figure = Figure(figsize=10.0 * size / size[0], dpi=130)
    # One pair of axes for all: drawing the ticks of many takes longer than the images.
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    text = partial(axes.annotate, fontsize=FONT_SIZE, ha="center", va="center")
    for n, row in enumerate(panels):
        top = -n * (tall + gap)
        text(f"{ranges[n]:g} km", (-1.2 * gap, top - tall / 2), rotation="vertical")
        for k, (image, extent, cells) in enumerate(row):
            start = k * (width + gap)
            frame = Rectangle((start, top - height), width, height, transform=axes.transData)
            moved = extent + np.repeat([start - left, top - high], 2)
            axes.imshow(image, extent=moved, cmap="inferno", origin="lower").set_clip_path(frame)
            below = (start, start + width, top - tall, top - height)
            axes.imshow(cells, extent=below, cmap="Blues", origin="lower")
            span = f"{np.nanmin(image):.1f} to {np.nanmax(image):.1f} K"
            box = {"facecolor": "black", "edgecolor": "none", "alpha": 0.5, "pad": 1.5}
            text(span, (start + width - gap, top - gap), color="w", ha="right", bbox=box)
    for k, way in enumerate(ways):
        text(f"super-resolution: {printable(str(way))}", (k * (width + gap) + width / 2, gap))
    axes.plot([0.0, SCALE_BAR], [-size[1] + margin] * 2, color="k", lw=2)
    aspect, frames = float(view.aspect), int(view.frame_count)
    words = f"{SCALE_BAR:g} m; {printable(str(ship))}, aspect {aspect:g}°, {frames} frames; "
    words += "below each image its log-polar map, radius over angle"
    text(words, (SCALE_BAR + gap, -size[1] + margin), ha="left")
    axes.set(xlim=(gap - margin, size[0] - margin), ylim=(margin - gap - size[1], margin - gap))
    axes.set_axis_off()
    return figure


def _image_and_map(view: xr.Dataset) -> tuple[Floats, Floats, NDArray[Any]]:
    """Return an image without its empty margins, its edges [m] and its log-polar map."""
    return *_crop_image(view), view.log_polar.transpose("radius", "angle").values


def _crop_image(view: xr.Dataset) -> tuple[Floats, Floats]:
    """Return an image without its empty margins, and its edges [m]."""
    image = view.image.transpose("row", "col").values
    row, column = (np.isfinite(image).any(axis=axis) for axis in (1, 0))
    axes = view.horizontal.values[column], view.vertical.values[row]
    half = [(axis[-1] - axis[0]) / (len(axis) - 1) / 2 for axis in axes]
    edges = [(axis[0] - h, axis[-1] + h) for axis, h in zip(axes, half, strict=True)]
    return image[np.ix_(row, column)], np.ravel(edges)


def draw_confused(store: PathOrUrl, ships: tuple[str, str], aspect: float) -> Figure:
    """Draw two ships side by side at an aspect: range profiles, and images of each."""
    from matplotlib.figure import Figure

    root = open_store(store)
    rows = [group for group in DRAW_VIEW if group in list_groups(root)]
    figure = Figure(figsize=(5.6, 1.7 * len(rows) + 0.5), layout="constrained")
    panels = figure.subplots(len(rows), 2, sharex="row", sharey="row", squeeze=False)
    for row, group in zip(panels, rows, strict=True):
        for axes, ship in zip(row, ships, strict=True):
            DRAW_VIEW[group](axes, root, ship, aspect)
    for axes, ship in zip(panels[0], ships, strict=True):
        axes.set_title(f"{printable(ship)}, {aspect:g}°", fontsize=FONT_SIZE + 1)
    return figure


def _draw_profile(axes: Axes, store: Any, ship: str, aspect: float) -> None:
    """Draw the expected range profile of one view."""
    profiles = read_group(store, "range_profile")[["expected"]]
    profiles = select_preferred(profiles, keep=("ship", "aspect"))
    profile = profiles.expected.sel(ship=ship).sel(aspect=aspect, method="nearest").load()
    axes.plot(profile.down_range, profile, lw=1.1)
    axes.set_xlabel("down-range [m]", fontsize=FONT_SIZE)
    axes.set_yticks([])


def _draw_silhouette(axes: Axes, store: Any, ship: str, aspect: float) -> None:
    """Draw the infrared image of one view, at the shortest range."""
    keep = "ship", "aspect", "range", "row", "col"
    images = select_preferred(read_group(store, "infrared"), keep=keep)
    view = images.sel(ship=ship).sel(aspect=aspect, method="nearest")[["image"]]
    image, extent = _crop_image(view.sel(range=view.range.min()).load())
    left, right, low, high = extent
    axes.imshow(image, extent=(left, right, low, high), cmap="inferno", origin="lower")
    axes.set_xlabel("across [m]", fontsize=FONT_SIZE)
    axes.set_yticks([])


DRAW_VIEW = {"range_profile": _draw_profile, "infrared": _draw_silhouette}
"""Drawings of one view, by the group of a store that they show."""


def draw_flights(
    store: PathOrUrl, *, ship: Callable[[str], trimesh.Trimesh] | None = None
) -> dict[str, Callable[[], Figure]]:
    """Return functions that draw the corrections of flights, by names of files.

    One flight for each ship, range and aspect, at the preferred value of any other axis. `ship`
    returns the mesh of a label, instead of the known ship of that name. Raises ValueError if the
    store has no flights, or its ships are unknown.
    """
    from sweeps.report.flights import (
        correction_stages,
        draw_stages,
        flights_of,
        known_ship,
        scan_of,
    )

    root = open_store(store)
    if "validation" not in root:
        raise ValueError(f"{str(store)!r} has no flights, but must be the store of a sweep of irar")
    attrs = attributes(root)
    load = ship or partial(known_ship, attrs)
    flights = flights_of(read_group(root, "validation"))
    meshes = {label: load(label) for label in {flight.ship.item() for flight in flights.values()}}

    def draw_flight(title: str, flight: xr.Dataset) -> Figure:
        mesh = meshes[flight.ship.item()]
        simulated = scan_of(attrs, flight, mesh)
        return draw_stages(
            correction_stages(mesh, **simulated), title, simulated["scan"].flight.slant_range
        )

    return {
        "flight_{}_{:g}km_{:g}deg.png".format(
            re.sub(r"[^\w.-]", "_", flight.ship.item()), flight.range.item(), flight.aspect.item()
        ): partial(draw_flight, title, flight)
        for title, flight in flights.items()
    }


def write_pictures(
    path: PathOrUrl, console: Console, *, ship: Callable[[str], trimesh.Trimesh] | None = None
) -> list[Path]:
    """Draw every stage of the corrections of each flight beside the tables; see `draw_flights`.

    Returns the paths at which other files are in the way. Raises ConfigurationError if one cannot
    be drawn or written.
    """
    stderr, folder, blocked = Console(stderr=True), tables_folder(path), list[Path]()
    try:
        drawn = draw_flights(path, ship=ship)
        for name, make in track(drawn.items(), description="  pictures        ", console=stderr):
            content = io.BytesIO()
            make().savefig(content, format="png")
            blocked += write_own_files(folder, {name: content.getvalue()})
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"pictures are not drawn: {error}") from error
    with buffered_console(console) as buffer:
        print_line(f"pictures  {printable(str(folder))}: {', '.join(drawn)}", buffer)
    return list(dict.fromkeys(blocked))


DRAW_GROUP: dict[str, Callable[[PathOrUrl], Figure]] = {
    "range_profile": draw_profiles,
    "infrared": draw_silhouettes,
    "validation": lambda path: next(iter(draw_flights(path).values()))(),
}
"""Pictures of the page, by the group of a store that they show."""


def pictures_of(
    path: PathOrUrl, store: Any, predictions: Mapping[str, xr.DataArray]
) -> dict[str, tuple[str, str]]:
    """Return pictures of a store's groups as PNG in base64, each with the reason of a failure.

    They include the ships most often confused in the predictions. A picture that fails is
    empty, and does not prevent the page.
    """
    drawn, present = {}, list_groups(store)
    for group in (name for name in (CONFUSED, *DRAW_GROUP) if name in present):
        try:
            draw = DRAW_GROUP.get(group)
            if group == CONFUSED:
                confused = most_confused(predictions) if {*DRAW_VIEW} & {*present} else None
                draw = confused and partial(draw_confused, ships=confused[0], aspect=confused[1])
            if draw is not None:
                drawn[group] = _draw_png(draw, path), ""
        except Exception as error:
            drawn[group] = "", error_reason(error)
    return drawn


def _draw_png(draw: Callable[[PathOrUrl], Figure], path: PathOrUrl) -> str:
    """Return the picture that `draw` makes of a store, as PNG in base64."""
    content = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of figures smaller than labels
        draw(path).savefig(content, format="png", dpi=DPI)
    return base64.b64encode(content.getvalue()).decode("ascii")


def describe_ships(store: Any) -> list[dict[str, Any]]:
    """Return the ships that a store describes; none where it has no such group.

    Each has its label, its measures by name (number and unit), its picture and its warning.
    """
    if SHIPS not in list_groups(store):
        return []
    table = read_group(store, SHIPS).load()
    units = {n: unit_of(str(table[n].attrs.get("units", "1"))) for n in DIMENSIONS if n in table}
    ships = []
    for label in table.ship.values.tolist():
        row = table.sel(ship=label)
        measures = {name: (float(row[name]), unit) for name, unit in units.items()}
        picture = encode_png(row.picture.values) if "picture" in row else ""
        warning = str(row.warning.item()) if "warning" in row else ""
        ship = {"label": str(label), "measures": measures, "picture": picture}
        ships.append(ship | {"warning": warning})
    return ships


def encode_png(brightness: NDArray[np.floating]) -> str:
    """Return a picture, (row, column), from 0 to 1 and the lowest row first, as PNG in base64.

    NaN is transparent. Empty if all is NaN.
    """
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.image import imsave

    if not np.isfinite(brightness).any():
        return ""
    content, colours = io.BytesIO(), LinearSegmentedColormap.from_list("ship", SHIP_COLOURS)
    imsave(content, brightness, cmap=colours, vmin=0, vmax=1, origin="lower", format="png")
    return base64.b64encode(content.getvalue()).decode("ascii")
