"""The article's unstated parameters, with the values that each may have."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.article import SHIPS

CLASSES = 8
"""Equally probable classes of numbers, in which a posterior is compared with its prior."""

VARIANTS = 8
"""Variants of every ship's sheet that are drawn beside the sheet itself."""


@dataclass(frozen=True)
class Interval:
    """Prior of a number between `low` and `high`: uniform, or uniform in its logarithm.

    `label` states meaning and unit, `group` the part of the simulation; a logarithmic prior is
    uniform in log(value + `shift`), finite where `low` is 0.
    """

    low: float
    high: float
    label: str
    group: str
    logarithmic: bool = False
    shift: float = 0.0

    def at(self, share: float) -> float:
        """Return the quantile of a probability in [0, 1)."""
        if not self.logarithmic:
            return self.low + share * (self.high - self.low)
        first, last = (math.log(end + self.shift) for end in (self.low, self.high))
        return max(math.exp(first + share * (last - first)) - self.shift, self.low)

    def number(self, value: float) -> float:
        """Return the number that tables have for a value: the value itself."""
        return float(value)

    def share(self, numbers: ArrayLike) -> NDArray[np.float64]:
        """Return the cumulative probability of each number."""
        values = np.asarray(numbers, dtype=np.float64)
        if not self.logarithmic:
            return (values - self.low) / (self.high - self.low)
        first, last = (math.log(end + self.shift) for end in (self.low, self.high))
        share: NDArray[np.float64] = (np.log(values + self.shift) - first) / (last - first)
        return share

    def classes(self, numbers: ArrayLike) -> NDArray[np.intp]:
        """Return the class of each number, of `CLASSES` equally probable ones."""
        return np.minimum(CLASSES * self.share(numbers), CLASSES - 1).astype(np.intp)


@dataclass(frozen=True)
class Choice:
    """Prior of equally probable words or numbers of a list."""

    values: tuple[Any, ...]
    label: str
    group: str

    def at(self, share: float) -> Any:
        """Return the quantile of a probability in [0, 1)."""
        return self.values[int(share * len(self.values))]

    def number(self, value: Any) -> float:
        """Return the number that tables have for a value: its place in the list."""
        return float(self.values.index(value))

    def classes(self, numbers: ArrayLike) -> NDArray[np.intp]:
        """Return the class of each number: the number itself."""
        return np.asarray(numbers).astype(np.intp)


LADAR, ACN, MNN, INFRARED, SCENE = "laser radar", "ACN", "MNN", "infrared", "scene"
_SWITCH = (False, True)

PRIORS: Mapping[str, Interval | Choice] = MappingProxyType(
    {
        "depression": Choice(("fixed", "altitude"), "depression", SCENE),
        "place_right": Interval(0, 1, "place in a pixel, across [pixel]", SCENE),
        "place_up": Interval(0, 1, "place in a pixel, up [pixel]", SCENE),
        "moved": Choice(_SWITCH, "tests at another place", SCENE),
        **{
            f"variant_{ship}": Choice(
                tuple(range(VARIANTS + 1)), f"variant of {ship.title()}", SCENE
            )
            for ship in SHIPS
        },
        "target_free_ifovs": Interval(0, 20_000, "target-free IFOVs", LADAR, True, 200.0),
        "cnr": Interval(29, 35, "CNR at 100 km [dB]", LADAR),
        "ifov": Choice((150, 180), "IFOV [µrad]", LADAR),
        "reflectance": Choice(("projected_area", "lambertian"), "reflectance", LADAR),
        "floor": Choice(("edges", "median", "known"), "estimate of the floor", LADAR),
        "normalisation": Choice(("peak", "energy"), "normalisation of profiles", LADAR),
        "learning_rate": Interval(0.01, 0.5, "learning rate", ACN, True),
        "order": Choice(("ships", "aspects", "random"), "order of presentation", ACN),
        "learn_in_test": Choice(_SWITCH, "learning during the test", ACN),
        "label_rule": Choice(("majority", "first"), "label of a category", ACN),
        "mnn_tolerance": Interval(0.2, 0.5, "tolerance", MNN),
        "mnn_epochs": Interval(200, 800, "epochs at most", MNN, True),
        "mnn_learning_rate": Interval(0.005, 0.03, "step", MNN, True),
        "mnn_annealing": Choice(_SWITCH, "annealing of the gains", MNN),
        "mnn_scaling": Choice(("common", "standard"), "scaling of the inputs", MNN),
        "inner_radius": Interval(0.3, 0.7, "inner radius of the map", INFRARED),
        "interpolation": Choice(("nearest", "bilinear"), "interpolation of the map", INFRARED),
        "coverage_rule": Interval(0.1, 0.6, "coverage rule", INFRARED),
        "segmentation": Choice(("threshold", "matched"), "segmentation", INFRARED),
        "threshold": Interval(0.3, 0.7, "threshold over the contrast", INFRARED),
        "target_spread": Interval(0, 0.4, "spread of the ship [K]", INFRARED),
        "sea_spread": Interval(0, 0.4, "spread of the sea [K]", INFRARED),
    }
)
"""Parameters that the article leaves open, or states twice differently, by name."""


def assumed(number: int, *, seed: int = 0) -> dict[str, Any]:
    """Return a value for every name of `PRIORS`, in one of many settings.

    Settings are points of a scrambled Sobol sequence (Owen, Journal of Complexity 14, 466 (1998)),
    so a longer series continues a shorter one: a setting depends on its number and the seed alone.
    """
    from scipy.stats.qmc import Sobol

    series = Sobol(len(PRIORS), scramble=True, seed=seed)
    if number:  # scipy cannot go forward by 0
        series.fast_forward(number)
    shares = series.random(1)[0]
    return {
        name: prior.at(min(float(share), 1 - 2**-53))
        for (name, prior), share in zip(PRIORS.items(), shares, strict=True)
    }
