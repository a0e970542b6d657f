"""What a configuration may say of the classifiers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.errors import ConfigurationError
from sweeps.grid import (
    ClassifierGrid,
    between,
    count_axis,
    number_axis,
    ship_axis,
    switch_axis,
    word_axis,
)

ACN, MNN, CORRELATION, LIKELIHOOD, FUSION = "acn", "mnn", "correlation", "likelihood", "fusion"
CLASSIFIERS = (ACN, MNN, CORRELATION, LIKELIHOOD, FUSION)
WITH_MOMENTS = (LIKELIHOOD, FUSION)  # which need covariances
WITH_NOISE = (CORRELATION,)  # which may learn noisy profiles
WITH_LEFT_OUT = (CORRELATION, LIKELIHOOD)  # which may leave the true aspect out
EXPECTED, NOISY = "expected", "noisy"
LABEL_RULES, SCORE_RULES = ("majority", "first"), ("ship", "category")
INPUTS = ("raw", "floor_removed", "standardised")


@dataclass
class NetworkConfig:
    """The source's multilayered neural network."""

    epochs: Any = 1000
    grow_every: Any = 10
    learning_rate: Any = 0.015
    tolerance: Any = 0.35
    inputs: Any = "standardised"
    annealing: Any = True
    max_hidden: int = 25

    def __post_init__(self) -> None:
        """Check the ranges of what is no axis."""
        between("classifier.mnn.max_hidden", self.max_hidden, 1, 1000)


@dataclass
class ClassifierConfig:
    """Who names the ships."""

    name: Any = ACN
    learning_rate: Any = 0.1
    max_passes: int = 200
    learn_in_test: bool = False
    label_rule: Any = "majority"
    score_rule: Any = "ship"
    unknown: Any = None
    training_aspect: Any = None
    test_vigilance: Any = field(default_factory=lambda: {"start": 0, "stop": 1, "step": 0.01})
    training: Any = EXPECTED
    left_out: Any = False
    gain_sigma: Any = 1.0
    nugget: float = 1e-3
    mnn: NetworkConfig = field(default_factory=NetworkConfig)

    def __post_init__(self) -> None:
        """Check the ranges."""
        self.expand()
        between("classifier.max_passes", self.max_passes, 1, 1_000_000)
        between("classifier.nugget", self.nugget, 1e-9, 1000)

    def expand(self) -> ClassifierGrid:
        """Every value of every axis, checked."""
        key = "classifier."
        return ClassifierGrid(
            name=word_axis(key + "name", self.name, CLASSIFIERS),
            learning_rate=number_axis(
                key + "learning_rate", self.learning_rate, minimum=1e-6, maximum=1
            ),
            label_rule=word_axis(key + "label_rule", self.label_rule, LABEL_RULES),
            score_rule=word_axis(key + "score_rule", self.score_rule, SCORE_RULES),
            test_vigilance=number_axis(
                key + "test_vigilance", self.test_vigilance, minimum=0, maximum=1
            ),
            training=word_axis(key + "training", self.training, (EXPECTED, NOISY)),
            left_out=switch_axis(key + "left_out", self.left_out),
            gain_sigma=number_axis(key + "gain_sigma", self.gain_sigma, minimum=0, maximum=1000),
            epochs=count_axis(key + "mnn.epochs", self.mnn.epochs, maximum=1_000_000),
            grow_every=count_axis(key + "mnn.grow_every", self.mnn.grow_every, maximum=1_000_000),
            mnn_learning_rate=number_axis(
                key + "mnn.learning_rate", self.mnn.learning_rate, minimum=1e-6, maximum=1000
            ),
            tolerance=number_axis(
                key + "mnn.tolerance", self.mnn.tolerance, minimum=1e-6, maximum=0.999
            ),
            inputs=word_axis(key + "mnn.inputs", self.mnn.inputs, INPUTS),
            annealing=switch_axis(key + "mnn.annealing", self.mnn.annealing),
        )

    def learned(self, ships: tuple[str, ...], aspects: tuple[float, ...]) -> NDArray[np.bool_]:
        """Which views are learned; the others are only named, and ships among them unknown.

        Parameters
        ----------
        ships : (ship,) tuple of str
            Names of the ships of the grid.
        aspects : (aspect,) tuple of float
            Its aspects [deg].

        Returns
        -------
        (ship, aspect) bool ndarray

        Raises
        ------
        ConfigurationError
            If an unknown ship is no ship of the grid, a training aspect none of its aspects, or
            nothing is left to learn.
        """
        key = "classifier."
        unknown = () if self.unknown is None else ship_axis(key + "unknown", self.unknown)
        for name in unknown:
            if name not in ships:
                raise ConfigurationError(
                    f"{key}unknown has {name!r}, but every value must be one of "
                    f"{', '.join(ships)}, the values of grid.ship"
                )
        if len(unknown) == len(ships):
            raise ConfigurationError(
                f"{key}unknown has every ship of grid.ship, but must leave one to learn"
            )
        taught = aspects
        if self.training_aspect is not None:
            taught = number_axis(
                key + "training_aspect", self.training_aspect, minimum=0, below=360
            )
            for aspect in taught:
                if aspect not in aspects:
                    raise ConfigurationError(
                        f"{key}training_aspect has {aspect:g}, but every value must be one of "
                        "grid.aspect"
                    )
        known = np.array([ship not in unknown for ship in ships])
        return known[:, None] & np.isin(aspects, taught)

    def learning_rates(self) -> tuple[float, ...]:
        """Every value of `learning_rate`, checked."""
        return self.expand().learning_rate
