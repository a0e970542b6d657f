"""Where results lie in a store: the dimensions of a variable, and the coordinates of an axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.plan import Axis, Plan
from sweeps.engine.settings import Setting
from sweeps.engine.stage import Bound, Output
from sweeps.engine.zarr_array import Array


@dataclass(frozen=True)
class Layout:
    """How an output of a stage lies in the store.

    Attributes
    ----------
    bound, output
        The stage and its output.
    group : str
        Group of the store.
    axes : tuple of int
        Numbers of the axes that are dimensions, in their order.
    order : tuple of int
        Where each dimension of the variable comes from: these axes first, then its own ones.
    """

    bound: Bound
    output: Output
    group: str
    axes: tuple[int, ...]
    order: tuple[int, ...]

    def from_store(self, values: NDArray[Any]) -> NDArray[Any]:
        """A cell's values as its stage gave them, from those as they lie in the store."""
        own = [place - len(self.axes) for place in self.order if place >= len(self.axes)]
        return values.transpose(np.argsort(own)) if own else values

    def index(self, place: Mapping[int, int]) -> tuple[int | slice, ...]:
        """Where a cell lies in the variable, given its places on the axes."""
        lead = [place.get(number, 0) for number in self.axes]
        return tuple(lead[k] if k < len(lead) else slice(None) for k in self.order)


def layout_of(plan: Plan, bound: Bound, output: Output) -> Layout:
    """How an output of a stage lies in the store."""
    group = output.group or bound.stage.group
    assert group is not None
    left_out = set(output.without)
    numbers = [
        number
        for number in sorted({plan.axis_number(key) for key in bound.needs})
        if is_dimension(plan.axes[number])
        and not {one.name for one in plan.axes[number].settings} <= left_out
    ]
    order = {name: place for place, name in enumerate(bound.stage.dims)}

    def rank(number: int) -> tuple[int, int]:
        axis = plan.axes[number]
        renamed = bound.stage.names.get(axis.settings[0], "")
        words = [renamed, axis.name, *(one.name for one in axis.settings)]
        return (min((order[word] for word in words if word in order), default=-1), number)

    axes = tuple(sorted(numbers, key=rank))
    ranks = [rank(number)[0] for number in axes]
    ranks += [order.get(dim, len(order)) for dim in output.dims]
    dims = sorted(range(len(ranks)), key=lambda k: (ranks[k], k))
    return Layout(bound, output, group, axes, tuple(dims))


def is_dimension(axis: Axis) -> bool:
    """Whether an axis is a dimension of what depends on it, even with one value."""
    return axis.several or any(one.shown for one in axis.settings)


def joint_coordinates(axis: Axis, name: str) -> dict[str, Array]:
    """Coordinates of settings that run together: what a place is called, and their values."""
    labels = axis.labels or tuple(map(str, range(len(axis.points))))
    about = {"long_name": " and ".join(one.label for one in axis.settings) + ", together"}
    found = {name: Array.of((name,), np.array(labels, dtype=object), about)}
    for position, setting in enumerate(axis.settings):
        values = [point[position] for point in axis.points]
        label = setting.name if setting.name not in found else setting.key.replace(".", "_")
        found[label] = Array.of((name,), value_array(values), setting.attrs)
    return found


def axis_coordinates(axis: Axis, name: str) -> dict[str, Array]:
    """Coordinate of an axis of one setting, and what its kind adds to it."""
    (setting,) = axis.settings
    values = tuple(point[0] for point in axis.points)
    offered = getattr(setting.kind, "coordinates", None)
    if offered is None:
        return {name: Array.of((name,), value_array(values), setting.attrs)}
    return {
        label if place else name: Array.of((name,), array, attrs)
        for place, (label, (array, attrs)) in enumerate(offered(values).items())
    }


def scalar_coordinates(setting: Setting, name: str, value: Any) -> dict[str, Array]:
    """The one value of a setting as a scalar coordinate."""
    offered = getattr(setting.kind, "coordinates", None)
    if offered is None:
        return {name: Array.of((), value_array([value])[0], setting.attrs)}
    return {
        label: Array.of((), np.asarray(array)[0], attrs)
        for place, (label, (array, attrs)) in enumerate(offered((value,)).items())
        if place
    }


def value_array(values: Sequence[Any]) -> NDArray[Any]:
    """(value,) ndarray: floats, with NaN for null, integers, booleans, or texts as objects."""
    if any(isinstance(value, str | tuple) for value in values):
        array = np.empty(len(values), dtype=object)
        array[:] = [str(value) for value in values]  # plain ones, of whatever class they are
        return array
    if any(value is None for value in values):
        return np.array([np.nan if value is None else value for value in values], dtype=float)
    return np.array(values)
