"""Passive infrared: radiometry, silhouettes, thermal images, super-resolution, detection."""

from ncti.infrared.bands import LONG_WAVE, MID_WAVE, band_contrast
from ncti.infrared.detection import detection_probability, detection_threshold
from ncti.infrared.detector_view import DetectorView, LargestWindow
from ncti.infrared.hits import Hits
from ncti.infrared.imager import Imager, image
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
from ncti.infrared.silhouette import Silhouette, coverage_of, footprint, silhouette
from ncti.infrared.super_resolution import reconstruction_error, shifted_images
from ncti.infrared.synthesis import SUPER_RESOLUTIONS, pixel_sigma, thermal_images

__all__ = [
    "CONTRAST_AT_ZERO",
    "EXTINCTION",
    "IFOV",
    "LONG_WAVE",
    "MID_WAVE",
    "NEDT",
    "SPREAD",
    "SUPER_RESOLUTIONS",
    "DetectorView",
    "Hits",
    "Imager",
    "LargestWindow",
    "Silhouette",
    "attenuation",
    "band_contrast",
    "contrast",
    "coverage_of",
    "detection_probability",
    "detection_threshold",
    "footprint",
    "image",
    "noise_temperature",
    "pixel_sigma",
    "reconstruction_error",
    "shifted_images",
    "silhouette",
    "snr",
    "thermal_images",
]
