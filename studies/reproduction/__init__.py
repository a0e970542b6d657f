"""The article's Tables 2 to 5 over its unstated parameters: priors, and simulated tables."""

from studies.reproduction.assumptions import PRIORS, Choice, Interval, assumed
from studies.reproduction.fits import FITS, Agreement
from studies.reproduction.setting import draw, reproduce
from studies.reproduction.simulated import Simulated

__all__ = [
    "FITS",
    "PRIORS",
    "Agreement",
    "Choice",
    "Interval",
    "Simulated",
    "assumed",
    "draw",
    "reproduce",
]
