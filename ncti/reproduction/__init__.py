"""The article's Tables 2 to 5 over what it leaves open: parameters, and tables simulated."""

from ncti.reproduction.article import Figure, article_figures, figures, in_order
from ncti.reproduction.assumptions import PRIORS, SHIPS, Choice, Interval, assumed
from ncti.reproduction.fits import FITS, Agreement
from ncti.reproduction.setting import draw, reproduce
from ncti.reproduction.simulated import Simulated

__all__ = [
    "FITS",
    "PRIORS",
    "SHIPS",
    "Agreement",
    "Choice",
    "Figure",
    "Interval",
    "Simulated",
    "article_figures",
    "assumed",
    "draw",
    "figures",
    "in_order",
    "reproduce",
]
