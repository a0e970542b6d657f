"""Axes, unit and origin of a mesh file: the transform from its coordinates to the ship frame."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_each, require_word
from ncti.ships.errors import ShipError, short_repr

AXES = ("x", "y", "z", "-x", "-y", "-z")
MIN_SCALE, MAX_SCALE = 1e-9, 1e6
MAX_OFFSET = 1e7  # offset [m], enough for the coordinates of a map

_ORIGIN = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Transform:
    """Turn, scale and shift a mesh into the ship frame, in this order.

    Parameters
    ----------
    up, forward : {"x", "y", "z", "-x", "-y", "-z"}
        Axes of the file that point up and to the bow. `forward` is x when not given; where `up` is
        along x, it is -z for x and z for -x.
    scale : float
        Metres in a unit of the file, above 0.
    offset : (3,) sequence of float
        Added after turning and scaling [m]: forward, to port, up.
    repair : bool
        Whether openings of the surface are then closed: those of at most 5 % of it together, and
        any below the waterline.

    Raises
    ------
    ShipError
        If a value is not allowed, or `up` and `forward` are parallel.

    Notes
    -----
    Always a rotation, never a mirror image: port is up x forward.

    Examples
    --------
    A mesh with y up and its bow along -z, in millimetres:

    >>> from ncti.ships import Transform
    >>> transform = Transform(up="y", forward="-z", scale=0.001)
    >>> transform.apply([[0.0, 12_000.0, -60_000.0]]).tolist()
    [[60.0, 0.0, 12.0]]
    >>> str(transform)
    'up: y, forward: -z, scale: 0.001'

    See Also
    --------
    ncti.ships.load : loads a ship by a transform.
    ncti.ships.describe : finds a transform for a mesh that is not in the ship frame.
    """

    up: str = "z"
    forward: str | None = None
    scale: float = 1.0
    offset: Sequence[float] = _ORIGIN
    repair: bool = False

    def __post_init__(self) -> None:
        try:
            require_word("up", self.up, AXES)
            forward = _default_forward(self.up) if self.forward is None else self.forward
            require_word("forward", forward, AXES)
            require("scale", self.scale, minimum=MIN_SCALE, maximum=MAX_SCALE)
            require_each("offset", self.offset, 3, minimum=-MAX_OFFSET, maximum=MAX_OFFSET)
        except ValueError as error:
            raise ShipError(f"{error}.") from None
        if forward[-1] == self.up[-1]:
            raise ShipError(
                f"forward is {forward!r}, but must be along another axis than up, {self.up!r}."
            )
        if not isinstance(self.repair, bool):
            raise ShipError(f"repair is {short_repr(self.repair)}, but must be True or False.")
        # Adding 0.0 turns -0.0 into 0.0, so that equal transforms have equal digests.
        offset = tuple(float(shift) + 0.0 for shift in self.offset)
        for name, value in (("forward", forward), ("scale", float(self.scale)), ("offset", offset)):
            object.__setattr__(self, name, value)

    @property
    def is_identity(self) -> bool:
        """True if coordinates stay as they are."""
        return self == Transform()

    @property
    def axes(self) -> NDArray[np.float64]:
        """(3, 3) float64 ndarray: unit vectors forward, to port and up in the file, as rows."""
        forward, up = _unit(str(self.forward)), _unit(self.up)
        return np.array([forward, np.cross(up, forward), up])

    def apply(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return points in the ship frame, (point, 3) [m], from those in the file's coordinates."""
        turned = np.asarray(points, dtype=np.float64) @ self.axes.T
        return self.scale * turned + np.array(self.offset)

    def undo(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return points in the file's coordinates from those in the ship frame, (point, 3) [m]."""
        back = (np.asarray(points, dtype=np.float64) - np.array(self.offset)) / self.scale
        return back @ self.axes

    def compose(self, other: Transform) -> Transform:
        """Return the composition of this transform followed by another."""
        axes = other.axes @ self.axes
        shift = other.scale * (other.axes @ np.array(self.offset)) + np.array(other.offset)
        return Transform(
            up=_axis_name(axes[2]),
            forward=_axis_name(axes[0]),
            scale=self.scale * other.scale,
            offset=shift.round(9).tolist(),
            repair=self.repair or other.repair,
        )

    def digest(self, content: str) -> str:
        """Return the hash of a transformed mesh from the mesh's hash; the identity preserves it."""
        if self.is_identity:
            return content
        text = repr((content, self.up, self.forward, self.scale, self.offset, self.repair))
        return hashlib.sha256(text.encode()).hexdigest()

    def __str__(self) -> str:
        """Return the differences from the identity, as a configuration has them: "up: y"."""
        words = [f"up: {self.up}"] if self.up != "z" else []
        if self.forward != _default_forward(self.up):
            words.append(f"forward: {self.forward}")
        if self.scale != 1.0:
            words.append(f"scale: {self.scale:.12g}")
        if self.offset != _ORIGIN:
            words.append(f"offset: [{', '.join(f'{shift:.12g}' for shift in self.offset)}]")
        words += ["repair: true"] if self.repair else []
        return ", ".join(words)


def _default_forward(up: str) -> str:
    return {"x": "-z", "-x": "z"}.get(up, "x")


def _unit(axis: str) -> NDArray[np.float64]:
    unit = np.zeros(3)
    unit["xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return unit


def _axis_name(unit: Any) -> str:
    """Return the name of the axis along a unit vector."""
    place = int(np.abs(unit).argmax())
    return ("-" if unit[place] < 0 else "") + "xyz"[place]
