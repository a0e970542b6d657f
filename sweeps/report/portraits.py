"""Ships as pictures: the range image, shaded by its own slopes and coloured by its own ranges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from ncti.render import RangeImage, range_image

Floats = NDArray[np.float64]

SAMPLES = 3  # pixels of the range image along each side of a pixel of the picture
LIGHT = (0.4, 0.6, 0.69)  # towards the light: right, up, towards the sensor
AMBIENT, HEADLIGHT, KEYLIGHT = 0.2, 0.25, 0.75


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
    """A ship as its range image shows it, at view angles [deg], by pixels [m].

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
    return Portrait(
        np.clip(mixed, 0.0, 1.0), (left, left + wide * pixel, bottom, bottom + tall * pixel)
    )


def shading(image: RangeImage) -> Floats:
    """Brightness of every pixel of an unrolled image, (row, col); NaN where there is none.

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
