"""Arguments of functions as results of stages: values with their names, and objects of arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.declare.settings import Setting, Settings

Keywords = tuple[tuple[str, Any], ...]  # values with their names
Kind = TypeVar("Kind")


def keywords(**values: Any) -> Keywords:
    """Return some values with their names: a derived stage with the arguments of a function."""
    return tuple(values.items())


def settings_by_dimension(settings: Iterable[Setting]) -> dict[str, Setting]:
    """Return settings by the names of their dimensions."""
    return {setting.name: setting for setting in settings}


def settings_by_last_word(settings: type[Settings]) -> dict[str, Setting]:
    """Return the settings of a group by the last words of their keys."""
    return {setting.key.rpartition(".")[2]: setting for setting in settings.declared}


def restore(kind: Callable[..., Kind], arrays: Mapping[str, NDArray[Any]]) -> Kind:
    """Rebuild an object from the arrays of its `vars`; zero-dimensional arrays become numbers.

    The cache stores dataclasses of arrays and numbers in this form.
    """
    values = {name: np.asarray(array) for name, array in arrays.items()}
    return kind(**{name: array if array.ndim else array.item() for name, array in values.items()})
