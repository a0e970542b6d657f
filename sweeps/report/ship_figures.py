"""Pictures of ships, from their range images, and of their range profiles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

import ncti.ships
from ncti.features import profile_vector
from ncti.render import RangeImage, range_image
from sweeps.report.axes import nominal
from sweeps.report.style import HEADING, LABEL, SHIP_COLOURS, titled

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]

FLEET = (("duncan", "spruance"), ("roberts", "texas"), ("connole", "horne"))
VIEW = {"aspect": 57.0, "depression": 10.0}  # [deg]
PIXEL = 0.18  # of the picture of the ships [m]
SAMPLES = 3  # pixels of the range image along each side of a pixel of the picture
LIGHT = (0.4, 0.6, 0.69)  # towards the light: right, up, towards the sensor
AMBIENT, HEADLIGHT, KEYLIGHT = 0.2, 0.25, 0.75
NEAR_AND_FAR = 56.0  # the colours of ranges span this much to either side of the origin [m]
SEA, INK = "#0b1626", "#e8eef2"
RAMP = LinearSegmentedColormap.from_list("range", ["#ffe6b8", "#8ed3c0", "#3f8ddb"])

# The source's examples: its Figures 3 to 5.
ASPECTS, ASPECT, PULSE_WIDTH, RANGE = (0.0, 30.0, 60.0, 90.0), 30.0, 30.0, 100.0
STEP, NOISY_STEP = 1.12, 1.7  # from one profile to the next, in units of the peak
LIFT = 0.17  # of a label above its line, in units of the peak


@dataclass(frozen=True, eq=False)
class Portrait:
    """A ship in colours.

    Colour is (row, col, 4): red, green, blue and opacity, row 0 the lowest; extent left, right,
    bottom and top [m], from the line of sight through the ship origin.
    """

    colour: Floats
    extent: tuple[float, float, float, float]


def portrait(
    mesh: trimesh.Trimesh,
    *,
    aspect: float,
    depression: float,
    pixel: float,
    tint: Callable[[Floats], ArrayLike],
) -> Portrait:
    """Return the picture of a ship from its range image, given view angles [deg] and pixel [m].

    Tints come from down-range [m]. Smoothed by averaging `SAMPLES` by `SAMPLES` pixels of the range
    image into one.
    """
    image = range_image(
        mesh, aspect=aspect, depression=depression, pixel=pixel / SAMPLES, roll=0.0, engine="auto"
    )
    hit = image.hit
    colour = np.zeros((*hit.shape, 4))
    colour[hit, :3] = np.asarray(tint(image.down_range[hit]))[:, :3] * shading(image)[hit, None]
    colour[hit, 3] = 1.0
    left, bottom = (centre - image.pixel / 2 for centre in image.origin)
    # The picture's pixels are on a lattice of their own, fixed to the ship as the image's are.
    before = [round(edge / image.pixel) % SAMPLES for edge in (bottom, left)]
    after = [-(size + lead) % SAMPLES for size, lead in zip(hit.shape, before, strict=True)]
    padded = np.pad(colour, [*zip(before, after, strict=True), (0, 0)])
    tall, wide = (size // SAMPLES for size in padded.shape[:2])
    mixed = padded.reshape(tall, SAMPLES, wide, SAMPLES, 4).mean(axis=(1, 3))
    opacity = mixed[..., 3:]
    mixed[..., :3] /= np.where(opacity > 0, opacity, 1.0)
    left, bottom = left - before[1] * image.pixel, bottom - before[0] * image.pixel
    extent = (left, left + wide * pixel, bottom, bottom + tall * pixel)
    return Portrait(np.clip(mixed, 0.0, 1.0), extent)


def shading(image: RangeImage) -> Floats:
    """Return the brightness of pixels of an unrolled image, (row, col); NaN where there is none.

    A lamp at the sensor and one above its right shoulder, on a diffuse surface.

    Notes
    -----
    The surface r(h, v) has the outward normal (dr/dh, dr/dv, 1) / sqrt(1 + |grad r|^2) along
    right, up and towards the sensor; its last component is the cosine of incidence.
    """
    slope = image.gradient.astype(np.float64)
    incidence = 1.0 / np.sqrt(1.0 + (slope**2).sum(axis=-1))
    right, up, towards = np.array(LIGHT) / np.linalg.norm(LIGHT)
    lit = (slope[..., 0] * right + slope[..., 1] * up + towards) * incidence
    shade: Floats = AMBIENT + HEADLIGHT * incidence + KEYLIGHT * np.maximum(lit, 0.0)
    return shade


def _tint(down_range: ArrayLike) -> Floats:
    return np.asarray(RAMP(np.asarray(down_range) / (2 * NEAR_AND_FAR) + 0.5))


def draw_ships() -> Figure:
    """Draw the six ships to one scale, coloured by range."""
    width, height, dpi = 318.0, 186.0, 200.0
    figure = Figure(figsize=(width / PIXEL / dpi, height / PIXEL / dpi), dpi=dpi, facecolor=SEA)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, width), ylim=(0.0, height), aspect="equal")
    axes.axis("off")
    for row, waterline in zip(FLEET, (136.0, 80.0, 25.0), strict=True):
        for name, left in zip(row, (8.0, 150.0), strict=True):
            mesh = ncti.ships.load(name)
            picture = portrait(mesh, **VIEW, pixel=PIXEL, tint=_tint)
            extent = picture.extent
            # One pixel of the picture per pixel of the figure.
            x, y = (round(k / PIXEL) * PIXEL for k in (left - extent[0], waterline))
            place = (extent[0] + x, extent[1] + x, extent[2] + y, extent[3] + y)
            axes.imshow(picture.colour, origin="lower", extent=place, interpolation="nearest")
            x, y, length = left + 1.0, waterline + 22.0, f"{mesh.metadata['loa']:.1f} m"
            axes.text(x, y, name.capitalize(), color=INK, fontsize=11, weight="bold", va="bottom")
            axes.text(x, y - 1.0, length, color=INK, fontsize=8, alpha=0.75, va="top")
    axes.plot([10.0, 10.0, 60.0, 60.0], [8.0, 7.0, 7.0, 8.0], color=INK, linewidth=1)
    ramp = _tint(np.linspace(-NEAR_AND_FAR, NEAR_AND_FAR, 256))[None]
    left, right, far = width - 92.0, width - 32.0, f"{NEAR_AND_FAR:.0f} m"
    axes.imshow(ramp, extent=(left, right, 5.8, 8.2))
    for x, text, side in (
        (62.0, "50 m across the line of sight", "left"),
        (left - 2, f"down-range −{far}", "right"),
        (right + 2, f"+{far}", "left"),
    ):
        axes.text(x, 7.0, text, color=INK, fontsize=7, va="center", ha=side)
    return figure


def draw_profiles(profiles: xr.Dataset) -> Figure:
    """Draw profiles as classifiers see them: by aspect, by ship, and by number of frames."""
    here = nominal(profiles, keep=("ship", "aspect", "range", "pulse_width", "frame_count"))
    here = here.sel(range=RANGE, pulse_width=PULSE_WIDTH, method="nearest")
    name = here.ship[0].item().capitalize()
    turned = here.isel(ship=0).expected.sel(aspect=list(ASPECTS), method="nearest")
    turned = turned.drop_duplicates("aspect")
    quarter = here.sel(aspect=ASPECT, method="nearest")
    averaged = quarter.averaged.isel(ship=0).sortby("frame_count")
    aspects, ships = turned.aspect.values, quarter.ship.values
    counts, here_at = averaged.frame_count.values, f"{quarter.aspect.item():g}°"

    figure = Figure(figsize=(11.0, 4.6), dpi=150)
    figure.set_layout_engine("constrained", wspace=0.08)
    by_aspect, by_ship, by_frames = figure.subplots(1, 3)
    colours = colormaps["viridis"](np.linspace(0.1, 0.75, aspects.size))
    _stack(by_aspect, turned, [f"{aspect:g}°" for aspect in aspects], colours)
    tints = [SHIP_COLOURS[place % len(SHIP_COLOURS)] for place in range(ships.size)]
    names = [label.capitalize() for label in ships]
    _stack(by_ship, quarter.expected, names, [to_rgba(tint) for tint in tints])
    colours = colormaps["Reds"](np.linspace(0.5, 0.9, counts.size))
    labels = ["1 frame" if count == 1 else f"{count} frames" for count in counts]
    _stack(by_frames, averaged, labels, colours, behind=quarter.expected.isel(ship=0))
    by_aspect.set_title(f"{name}, bow (0°) to beam (90°)", fontsize=HEADING)
    by_ship.set_title(f"Ships at {here_at}", fontsize=HEADING)
    by_frames.set_title(f"{name} at {here_at}, averages; grey: expected", fontsize=HEADING)
    by_aspect.set_ylabel("amplitude above the noise floor, peak 1", fontsize=LABEL)
    pulse = f"{here.pulse_width.item():g} ns pulses"
    titled(figure, f"Range profiles at {here.range.item():g} km, {pulse}")
    return figure


def _stack(
    axes: Axes,
    profiles: xr.DataArray,
    labels: Sequence[str],
    colours: ArrayLike,
    *,
    behind: xr.DataArray | None = None,
) -> None:
    """Draw stacked profiles, the first on top, each over another one if given."""
    down_range = profiles.down_range.values
    step = STEP if behind is None else NOISY_STEP
    lines = zip(profile_vector(profiles), labels, np.asarray(colours), strict=True)
    for place, (profile, label, colour) in enumerate(lines):
        base = step * (len(labels) - 1 - place)
        axes.axhline(base, color="0.85", linewidth=0.6, zorder=0)
        shade, style = profile, {"color": colour, "alpha": 0.25}
        if behind is not None:
            shade, style = profile_vector(behind), {"color": "0.8"}
        axes.fill_between(down_range, base, base + shade, lw=0, **style)
        axes.plot(down_range, base + profile, color=colour, linewidth=1.1)
        words: dict[str, Any] = {"weight": "bold", "fontsize": LABEL}
        words["color"] = 0.75 * np.asarray(colour)[:3]  # dark enough for text
        if behind is None:  # inside the axes, near the end of the window, which no ship reaches
            axes.text(down_range[-1], base + LIFT, label, ha="right", va="bottom", **words)
        else:  # beside the axes: noise fills the window
            axes.text(down_range[-1] + 4.0, base, label, va="center", **words)
    axes.set_xlim(down_range[0], down_range[-1])
    axes.set_xlabel("down-range from the ship origin [m]", fontsize=LABEL)
    axes.tick_params(labelsize=LABEL)
    axes.set_yticks([])
    axes.spines[["left", "right", "top"]].set_visible(False)
