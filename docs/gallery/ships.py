"""The six ships by range, as the laser radar sees them: ships.py PICTURE."""

import sys

import matplotlib.pyplot as plt
import numpy as np

import ncti

(picture,) = sys.argv[1:]
LIGHT = np.array([0.4, 0.6, 0.69])  # towards the light: right, up, towards the sensor
figure, panels = plt.subplots(3, 2, figsize=(11, 6.5), layout="constrained", facecolor="#0b1626")
for axes, name in zip(panels.ravel(), ncti.ships.names(), strict=False):
    mesh = ncti.ships.load(name)
    image = ncti.render.range_image(mesh, aspect=57, depression=10, pixel=0.25, roll=0.0)
    # The surface r(h, v) has the normal (dr/dh, dr/dv, 1) along right, up and towards the sensor.
    slope = np.nan_to_num(image.gradient)
    normal = np.concatenate([slope, np.ones((*slope.shape[:2], 1))], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    shade = 0.25 + 0.75 * np.clip(normal @ LIGHT, 0, 1)
    colour = plt.cm.viridis((image.down_range + 56) / 112)
    colour[..., :3] *= shade[..., None]
    colour[~image.hit, 3] = 0
    height, width = np.array(image.hit.shape) * image.pixel
    axes.imshow(colour, origin="lower", extent=(0, width, 0, height))
    axes.set_title(f"{name}, {mesh.metadata['loa']:.1f} m", color="white", fontsize="medium")
    axes.axis("off")
figure.savefig(picture, dpi=150)
