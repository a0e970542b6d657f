"""Coordinates of a store: the values of settings along the axes that they span."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.kinds import spelt
from sweeps.engine.plan import Axis
from sweeps.engine.settings import Setting
from sweeps.engine.zarr_array import Array


def axis_coordinates(axis: Axis, name: str) -> dict[str, Array]:
    """Return coordinates of an axis: its values, or those of every setting of a joint axis.

    The places of a joint axis are labelled by the values there, as in 'mass=3,limit=9', unless
    they have names. The kind of a setting may add others.
    """
    columns = list(zip(*axis.points, strict=True))
    if not axis.is_joint:
        return setting_coordinates(axis.settings[0], name, columns[0])
    found: dict[str, Array] = {}
    for setting, values in zip(axis.settings, columns, strict=True):
        label = setting.key.replace(".", "_") if setting.name in (name, *found) else setting.name
        found[label] = Array.of((name,), value_array(values), setting.attrs, coordinate=True)
    labels = axis.labels or [
        ",".join(f"{label}={spelt(value)}" for label, value in zip(found, point, strict=True))
        for point in axis.points
    ]
    about = {"long_name": " and ".join(one.label for one in axis.settings) + ", together"}
    return {name: Array.of((name,), np.array(labels), about, coordinate=True), **found}


def setting_coordinates(
    setting: Setting, name: str, values: Sequence[Any], *, scalar: bool = False
) -> dict[str, Array]:
    """Yield coordinates of a setting's values as its kind defines them, its own first."""
    offered = getattr(setting.kind, "coordinates", None)
    if offered is None:
        found = {name: (value_array(values), setting.attrs)}
    else:
        (_, own), *others = offered(tuple(values)).items()
        found = {**({} if scalar else {name: own}), **dict(others)}
    dims: tuple[str, ...] = () if scalar else (name,)
    return {
        label: Array.of(dims, array[0] if scalar else array, attrs, coordinate=True)
        for label, (array, attrs) in found.items()
    }


def value_array(values: Sequence[Any]) -> NDArray[Any]:
    """Return a (value,) ndarray: floats (NaN for null), integers, booleans or texts."""
    if any(isinstance(value, str | tuple) for value in values):
        # Convert subclasses to plain types.
        return np.array([str(value) for value in values])
    return np.array(values, dtype=float if None in values else None)
