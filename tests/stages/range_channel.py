"""Choices of the range channel, and synthetic profiles of one cell."""

from dataclasses import dataclass, replace

import numpy as np

from ncti.classify import GaussianTemplates
from sweeps.engine.declare.settings import read_choices
from sweeps.experiment import EXPERIMENT
from sweeps.stages import classifier
from sweeps.stages.arguments import settings_by_last_word

SHIPS = 3
# Aspects on both sides of every edge between aspect bins, and the numbers of their bins.
ASPECTS = (0.0, 29.9, 30.0, 59.9, 60.0, 90.0)
GROUP = np.array([0, 0, 1, 1, 2, 2])
FRAMES = (4, 16)
REPLICATES = 3
BINS = 60
EDGE = 5  # bins at either end, 8 % of them, that no ship reaches
FLOOR = 5.0
NAMED = ("a", "b", "c")

# Covariance of one frame at lags 0, 1 and 2, which `bands` scales differently for each view.
BAND = np.array([1.0, 0.4, 0.1])


def choose(**given):
    """Return choices of the range channel; keys have __ for dots."""
    return read_choices(
        EXPERIMENT.declared, {key.replace("__", "."): value for key, value in given.items()}
    )


def called(stage, **given):
    """Return the result of a stage, with the default in SI of every setting not given."""
    settings = {
        name: setting
        for group in stage.uses
        for name, setting in settings_by_last_word(group).items()
    }
    defaults = {
        key: settings[key].in_si(settings[key].default)
        for key in stage.arguments
        if key in settings
    }
    return stage(**defaults | given)


def learned(unknown=None, training_aspect=None):
    """Return the (ship, aspect) mask of the views below that are learned."""
    selection = classifier.AspectSelection(training_aspect, None, ())
    return classifier.training_views(NAMED, ASPECTS, unknown, selection)


@dataclass(frozen=True)
class Cell:
    """Profiles of one cell, as stages that gather ships and aspects get them.

    Attributes
    ----------
    expected : (ship, aspect, bin) float32 ndarray
    averaged : (replicate, frame_count, ship, aspect, bin) float32 ndarray
    valid : (ship, aspect) bool ndarray
    """

    expected: np.ndarray
    averaged: np.ndarray
    valid: np.ndarray

    def without(self, ship, aspect):
        """Return the cell with some views lost and filled with NaN, as the engine fills them."""
        valid = self.valid.copy()
        valid[ship, aspect] = False
        expected, averaged = self.expected.copy(), self.averaged.copy()
        expected[~valid] = averaged[:, :, ~valid] = np.nan
        return Cell(expected, averaged, valid)

    def changed(self, **arrays):
        """Return the cell with other arrays."""
        return replace(self, **arrays)


def made(noise=0.3, seed=0):
    """Return a cell of distinct profiles on a floor, and their averages with white noise."""
    rng = np.random.default_rng(seed)
    views = (SHIPS, len(ASPECTS), BINS)
    expected = np.full(views, FLOOR)
    expected[..., EDGE:-EDGE] += rng.exponential(size=(*views[:2], BINS - 2 * EDGE))
    deviation = noise / np.sqrt(np.array(FRAMES))[:, None, None, None]
    averaged = expected + deviation * rng.standard_normal((REPLICATES, len(FRAMES), *views))
    return Cell(
        expected.astype(np.float32), averaged.astype(np.float32), np.ones(views[:2], dtype=bool)
    )


def directions(profiles):
    """Return profile vectors of unit length, computed from their definition."""
    values = np.asarray(profiles, dtype=np.float64)
    ends = np.concatenate([values[..., :EDGE], values[..., -EDGE:]], axis=-1)
    above = values - ends.mean(axis=-1, keepdims=True)
    return above / np.linalg.norm(above, axis=-1, keepdims=True)


def bands(cell, variance=0.1):
    """Return a covariance of one frame for every view, (ship, aspect, lag, bin)."""
    shape = cell.valid.shape
    scale = variance * (1 + 0.01 * np.arange(cell.valid.size).reshape(shape))
    band = scale[..., None, None] * np.broadcast_to(BAND[:, None], (len(BAND), BINS))
    band = band.copy()
    for lag in range(1, len(BAND)):
        band[..., lag, BINS - lag :] = 0
    return band.astype(np.float32)


def dense(band):
    """Return the covariance matrix that a band of lags stands for."""
    covariance = np.diag(band[0].astype(np.float64))
    for lag in range(1, len(band)):
        beside = np.diag(band[lag, : BINS - lag].astype(np.float64), lag)
        covariance += beside + beside.T
    return covariance


def rows_of_densities(monkeypatch):
    """Return the list of the numbers of profiles whose densities are computed at once from now."""
    rows, compute = [], GaussianTemplates.log_likelihood

    def recorded(templates, profiles, *arguments, **options):
        rows.append(len(profiles))
        return compute(templates, profiles, *arguments, **options)

    monkeypatch.setattr(GaussianTemplates, "log_likelihood", recorded)
    return rows
