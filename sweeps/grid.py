"""The grid of a sweep: axes expanded from what the user wrote, and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import ncti.ships
from sweeps.errors import ConfigurationError

T = TypeVar("T")

LARGEST = 1e300  # beyond it a number is a slip, and integers need not fit a float
MAX_AXIS = 100_000  # longer axes are a slip of the step, not a plan


@dataclass(frozen=True)
class Grid:
    """Every value of every axis, in the units of the configuration.

    Attributes
    ----------
    ship : tuple of str
        Names or paths.
    aspect : tuple of float
        Aspect angles [deg].
    pulse_width : tuple of float
        1/e^2 pulse widths [ns].
    frame_count : tuple of int
        Frames averaged.
    range : tuple of float
        Slant ranges [km].
    vigilance : tuple of float
        Vigilance in training.
    replicate : tuple of int
        Numbers of independent draws of the noise of range profiles.
    """

    ship: tuple[str, ...]
    aspect: tuple[float, ...]
    pulse_width: tuple[float, ...]
    frame_count: tuple[int, ...]
    range: tuple[float, ...]
    vigilance: tuple[float, ...]
    replicate: tuple[int, ...]


@dataclass(frozen=True)
class InfraredGrid:
    """Every value of every axis of the infrared channel, in the units of the configuration.

    Attributes
    ----------
    range : tuple of float
        Slant ranges [km].
    super_resolution : tuple of str
        How images get finer than the detector.
    frame_count : tuple of int
        Frames averaged.
    coverage_rule : tuple of float
        Share of a pixel that a ship must fill for the pixel to be the ship's.
    segmentation : tuple of str
        How a silhouette is cut out of an image.
    inner_radius : tuple of float
        Inner radius of the log-polar map, in sqrt(area / pi).
    interpolation : tuple of str
        How the map samples a silhouette.
    phase, order : tuple of int
        Numbers of the places on the detector, and of the orders of presentation, that results
        are averaged over.
    vigilance : tuple of float
        Vigilance in training.
    """

    range: tuple[float, ...]
    super_resolution: tuple[str, ...]
    frame_count: tuple[int, ...]
    coverage_rule: tuple[float, ...]
    segmentation: tuple[str, ...]
    inner_radius: tuple[float, ...]
    interpolation: tuple[str, ...]
    phase: tuple[int, ...]
    order: tuple[int, ...]
    vigilance: tuple[float, ...]


@dataclass(frozen=True)
class ClassifierGrid:
    """What names ships, and every value of the axes of each of them.

    Attributes
    ----------
    name : tuple of str
        The classifiers.
    learning_rate : tuple of float
        Of the Adaptive Clustering Network.
    label_rule, score_rule : tuple of str
        How its categories get a name, and what counts as right.
    test_vigilance : tuple of float
        Similarities below which an answer is taken back.
    training : tuple of str
        What correlation is learned from: expected or noisy profiles.
    left_out : tuple of bool
        Whether templates of the true aspect are left out, of correlation and likelihood.
    gain_sigma : tuple of float
        How well likelihood knows the target's gain.
    epochs, grow_every : tuple of int
        Presentations, and how many of them before another hidden node.
    mnn_learning_rate : tuple of float
        Of the multilayered network.
    tolerance : tuple of float
        Root mean square error at which its training stops.
    inputs : tuple of str
        What it sees of a profile.
    annealing : tuple of bool
        Whether its gains are annealed.
    """

    name: tuple[str, ...]
    learning_rate: tuple[float, ...]
    label_rule: tuple[str, ...]
    score_rule: tuple[str, ...]
    test_vigilance: tuple[float, ...]
    training: tuple[str, ...]
    left_out: tuple[bool, ...]
    gain_sigma: tuple[float, ...]
    epochs: tuple[int, ...]
    grow_every: tuple[int, ...]
    mnn_learning_rate: tuple[float, ...]
    tolerance: tuple[float, ...]
    inputs: tuple[str, ...]
    annealing: tuple[bool, ...]


def ship_axis(key: str, spec: Any) -> tuple[str, ...]:
    """Ships of a grid: one name or path, or a list of them, each at most once."""
    names = [spec] if isinstance(spec, str) else spec
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise ConfigurationError(f"{key} is {spec!r}, but must be a ship, or a list of ships")
    return _distinct(key, [str(name) for name in names])


def word_axis(key: str, spec: Any, allowed: Sequence[str]) -> tuple[str, ...]:
    """Values of an axis of words: one or a list, each among those allowed, at most once."""
    words = [spec] if isinstance(spec, str) or not isinstance(spec, Sequence) else spec
    for word in words:
        if word not in allowed:
            raise ConfigurationError(
                f"{key} has {word!r}, but every value must be one of {', '.join(allowed)}"
            )
    return _distinct(key, [str(word) for word in words])


def ship_label(name: str) -> str:
    """What a ship is called: by its name, or by the name of its file."""
    return name if name in ncti.ships.names() else Path(name).stem


def number_axis(
    key: str,
    spec: Any,
    *,
    minimum: float = -math.inf,
    maximum: float = math.inf,
    below: float = math.inf,
    positive: bool = False,
) -> tuple[float, ...]:
    """Values of a numeric axis.

    Parameters
    ----------
    key : str
        The configuration key, for messages.
    spec : number, list of numbers, or mapping with start, stop and step
        What the user wrote. `stop` is included when a step lands on it.
    minimum, maximum : float
        Inclusive bounds.
    below : float
        Exclusive upper bound.
    positive : bool
        Whether 0 is refused too.

    Returns
    -------
    tuple of float
        Distinct values, in the order given.

    Raises
    ------
    ConfigurationError
        Naming the key, the value and what is allowed.
    """
    allowed = _allowed(minimum=minimum, maximum=maximum, below=below, positive=positive)
    listed = _steps(key, spec) if isinstance(spec, Mapping) else spec
    if isinstance(listed, str) or not isinstance(listed, Sequence):
        listed = [listed]
    values = []
    for value in listed:
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        inside = (
            is_number
            and max(minimum, -LARGEST) <= value <= min(maximum, LARGEST)
            and value < below
            and not (positive and value <= 0)
        )
        if not inside:
            raise ConfigurationError(f"{key} has {value!r}, but every value must be {allowed}")
        values.append(float(value))
    return _distinct(key, values)


def count_axis(
    key: str, spec: Any, *, minimum: int = 1, maximum: float = math.inf
) -> tuple[int, ...]:
    """Values of an axis of whole numbers; see `number_axis`."""
    values = number_axis(key, spec, minimum=minimum, maximum=maximum)
    for value in values:
        if value != int(value):
            raise ConfigurationError(f"{key} has {value!r}, but every value must be a whole number")
    return tuple(int(value) for value in values)


def optional_axis(
    key: str, spec: Any, *, minimum: float, maximum: float
) -> tuple[float | None, ...]:
    """Values of a numeric axis that may also be null, alone or in a list; see `number_axis`."""
    if spec is None:
        return (None,)
    if isinstance(spec, str) or not isinstance(spec, Sequence) or None not in spec:
        return number_axis(key, spec, minimum=minimum, maximum=maximum)
    given = [one for one in spec if one is not None]
    numbers = number_axis(key, given, minimum=minimum, maximum=maximum) if given else ()
    left = iter(numbers)
    return _distinct(key, [None if one is None else next(left) for one in spec])


def switch_axis(key: str, spec: Any) -> tuple[bool, ...]:
    """Values of an axis that is on or off: one, or a list of them, each at most once."""
    values = list(spec) if isinstance(spec, Sequence) and not isinstance(spec, str) else [spec]
    for value in values:
        if not isinstance(value, bool):
            raise ConfigurationError(
                f"{key} has {value!r}, but every value must be one of true, false"
            )
    return _distinct(key, values)


def _steps(key: str, spec: Mapping[str, Any]) -> list[float]:
    if set(spec) != {"start", "stop", "step"}:
        raise ConfigurationError(
            f"{key} has the keys {', '.join(map(str, spec)) or '(none)'}, but must have start, "
            "stop and step, or be a list"
        )
    for name, value in spec.items():
        if not isinstance(value, int | float):
            raise ConfigurationError(f"{key}.{name} is {value!r}, but must be a number")
    (start,) = number_axis(f"{key}.start", spec["start"])
    (stop,) = number_axis(f"{key}.stop", spec["stop"])
    (step,) = number_axis(f"{key}.step", spec["step"], positive=True)
    count = math.floor((stop - start) / step * (1 + 1e-12) + 1e-9) + 1
    if count < 1:
        raise ConfigurationError(
            f"{key} runs from {start:g} to {stop:g}, but stop must not be below start"
        )
    if count > MAX_AXIS:
        raise ConfigurationError(
            f"{key}.step is {step:g}, but must leave at most {MAX_AXIS} values"
        )
    # Rounded, so that 0.1 steps give 0.3 and not 0.30000000000000004.
    return [float(value) for value in np.round(start + step * np.arange(count), 12)]


def _distinct(key: str, values: list[T]) -> tuple[T, ...]:
    if not values:
        raise ConfigurationError(f"{key} is empty, but must hold at least one value")
    seen: set[T] = set()
    for value in values:
        if value in seen:
            raise ConfigurationError(f"{key} has {value!r} more than once, but values must differ")
        seen.add(value)
    return tuple(values)


def _allowed(*, minimum: float, maximum: float, below: float, positive: bool) -> str:
    bounds = ["above 0"] if positive else []
    if minimum > -math.inf:
        bounds.append(f"at least {minimum:g}")
    if maximum < math.inf:
        bounds.append(f"at most {maximum:g}")
    if below < math.inf:
        bounds.append(f"below {below:g}")
    return "a finite number" + (" " + " and ".join(bounds) if bounds else "")


def between(key: str, value: float, low: float, high: float) -> None:
    """Raise ConfigurationError unless a value is within inclusive bounds."""
    if not low <= value <= high:  # NaN fails too, and integers of any length compare
        raise ConfigurationError(f"{key} is {value!r}, but must be from {low:g} to {high:g}")


def one_of(key: str, value: str, allowed: tuple[str, ...]) -> None:
    """Raise ConfigurationError unless a word is among the allowed ones."""
    if value not in allowed:
        raise ConfigurationError(f"{key} is {value!r}, but must be one of {', '.join(allowed)}")
