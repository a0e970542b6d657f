"""Passive infrared: radiometry, silhouettes, thermal images, super-resolution, detection."""

from ncti.infrared.bands import (
    LONG_WAVE,
    MID_WAVE,
    band_contrast,
    band_radiance,
    radiance_slope,
)
from ncti.infrared.detection import detection_probability, detection_threshold
from ncti.infrared.radiometry import (
    CONTRAST_AT_ZERO,
    EXTINCTION,
    IFOV,
    NEDT,
    SPREAD,
    attenuation,
    contrast,
    noise_temperature,
    snr,
)
from ncti.infrared.silhouette import Silhouette, coverage_of, silhouette
from ncti.infrared.super_resolution import (
    BACK_PROJECTIONS,
    LEAST_CONTRAST,
    back_project,
    detector_samples,
    enlarge,
    noise_gain,
    recombine,
    reconstruction_error,
    scene_gain,
    shifted_images,
)
from ncti.infrared.synthesis import SUPER_RESOLUTIONS, image, pixel_sigma, thermal_images

__all__ = [
    "BACK_PROJECTIONS",
    "CONTRAST_AT_ZERO",
    "EXTINCTION",
    "IFOV",
    "LEAST_CONTRAST",
    "LONG_WAVE",
    "MID_WAVE",
    "NEDT",
    "SPREAD",
    "SUPER_RESOLUTIONS",
    "Silhouette",
    "attenuation",
    "back_project",
    "band_contrast",
    "band_radiance",
    "contrast",
    "coverage_of",
    "detection_probability",
    "detection_threshold",
    "detector_samples",
    "enlarge",
    "image",
    "noise_gain",
    "noise_temperature",
    "pixel_sigma",
    "radiance_slope",
    "recombine",
    "reconstruction_error",
    "scene_gain",
    "shifted_images",
    "silhouette",
    "snr",
    "thermal_images",
]
