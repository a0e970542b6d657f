"""Ships: watertight solids above the waterline, from sheets or a user's own meshes."""

from ncti.ships.errors import ShipError
from ncti.ships.loading import digest, load, names
from ncti.ships.symmetry import is_symmetric

__all__ = ["ShipError", "digest", "is_symmetric", "load", "names"]
