"""What classifiers have in common: which of them name the ships, and what they learn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ncti.features import profile_vector
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import Word
from sweeps.engine.settings import Choices, Settings, number, set_of, switch, word
from sweeps.engine.stage import Condition
from sweeps.stages.views import Grid, looks, ships

NONE = -1  # of a category, a ship, or an answer: the view is not there
STATE = {"flag_values": [-1, 0, 1], "flag_meanings": "missing failed done"}


class Classifier(Settings, key="classifier"):
    """Who names the ships; `among` says who there is."""

    name = word("acn", (), label="who names the ship", dimension="classifier", shown=True)
    unknown = set_of(ships(None, label="ships that are shown but never learned"))
    training_aspect = set_of(
        number(
            None,
            0,
            below=360,
            unit="degree",
            label="aspects learned at",
            help="of grid.aspect; null: all",
        )
    )
    test_vigilance = number(
        {"start": 0, "stop": 1, "step": 0.01},
        0,
        1,
        label="cosine that an answer must reach",
        help="below it, the answer is 'unknown'",
    )
    left_out = switch(
        False,
        label="1 where nothing is learned of the true aspect",
        help="of correlation and likelihood",
        noted=True,
    )


def among(*names: str) -> type[Settings]:
    """Return the settings of `Classifier`, whose `name` is one or more of some names."""
    named = {setting.key.rpartition(".")[2]: setting for setting in Classifier.declared}
    named["name"] = replace(Classifier.name, kind=Word(names))
    return type(
        "Classifier", (Settings,), {"__doc__": Classifier.__doc__, **named}, key="classifier"
    )


def names_by(name: str, sensor: str) -> Condition:
    """Return the condition that a classifier is chosen, and a sensor looks."""

    def chosen(choices: Choices) -> bool:
        return name in choices[Classifier.name] and looks(sensor)(choices)

    return chosen


def learned(
    ships: Sequence[str],
    aspects: Sequence[float],
    unknown: Sequence[str] | None,
    training_aspect: Sequence[float] | None,
) -> NDArray[np.bool_]:
    """Return which views are learned; the others are only named, and ships among them unknown.

    Parameters
    ----------
    ships : (ship,) sequence of str
        Ships of the grid.
    aspects : (aspect,) sequence of float
        Its aspects [deg].
    unknown : sequence of str or None
        Ships that are not learned.
    training_aspect : sequence of float or None
        Aspects [deg] that are learned; all when None.

    Returns
    -------
    (ship, aspect) bool ndarray
    """
    known = ~np.isin(np.array(ships, dtype=str), np.array(unknown or (), dtype=str))
    taught = np.isin(aspects, aspects if training_aspect is None else training_aspect)
    return known[:, None] & taught


def learned_of(choices: Choices) -> NDArray[np.bool_]:
    """Return the (ship, aspect) views that a sweep's classifiers learn."""
    return learned(
        choices[Grid.ship],
        choices[Grid.aspect],
        choices.one(Classifier.unknown),
        choices.one(Classifier.training_aspect),
    )


def check(choices: Choices) -> Choices:
    """Refuse unknown ships and training aspects that the grid lacks, or that leave nothing.

    Raises
    ------
    ConfigurationError
        Naming the first of them.
    """
    there = choices[Grid.ship]
    unknown = choices.one(Classifier.unknown) or ()
    for name in unknown:
        if name not in there:
            raise ConfigurationError(
                f"classifier.unknown has {str(name)!r}, but every value must be one of "
                f"{', '.join(there)}, the values of grid.ship"
            )
    if len(unknown) == len(there):
        raise ConfigurationError(
            "classifier.unknown has every ship of grid.ship, but must leave one to learn"
        )
    for aspect in choices.one(Classifier.training_aspect) or ():
        if aspect not in choices[Grid.aspect]:
            raise ConfigurationError(
                f"classifier.training_aspect has {aspect:g}, but every value must be one of "
                "grid.aspect"
            )
    return choices


def check_left_out(choices: Choices) -> None:
    """Refuse to leave the true aspect out where no other is learned.

    Raises
    ------
    ConfigurationError
        If `classifier.left_out` has true, and one aspect is learned.
    """
    taught = learned_of(choices).any(axis=0).sum()
    if any(choices[Classifier.left_out]) and taught < 2:
        raise ConfigurationError(
            f"classifier.left_out has True, but must be false where {taught} aspect is "
            "learned: nothing would be left"
        )


def require_another_aspect(taught: NDArray[np.bool_], left_out: tuple[bool, ...]) -> None:
    """Refuse to leave the true aspect out where fewer than two are taught.

    Raises
    ------
    ValueError
        Of views that are not there, and so are not taught.
    """
    if any(left_out) and taught.any(axis=0).sum() < 2:
        raise ValueError(
            "classifier.left_out has True, but must be false where fewer than two aspects are "
            "learned: nothing would be left"
        )


def profile_vectors(profiles: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return (..., ship, aspect, bin) profiles as (..., view, bin) vectors, zero where missing."""
    flat = profiles.reshape(*profiles.shape[:-3], -1, profiles.shape[-1])
    return profile_vector(np.where(np.isfinite(flat), flat, 0.0))


def state(correct: NDArray[np.integer], there: NDArray[np.bool_]) -> NDArray[np.int8]:
    """Return the state of answers: done, failed where the view is not there, missing if unasked."""
    return np.where(correct >= 0, 1, np.where(there, -1, 0)).astype("i1")


SETTINGS: tuple[type[Settings], ...] = (Classifier,)
