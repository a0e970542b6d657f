"""Ships: watertight solids above the waterline, from sheets or a user's own meshes."""

from ncti.ships.errors import ShipError
from ncti.ships.loading import Description, describe, digest, load, names, variants
from ncti.ships.symmetry import is_symmetric
from ncti.ships.transform import Transform

__all__ = [
    "Description",
    "ShipError",
    "Transform",
    "describe",
    "digest",
    "is_symmetric",
    "load",
    "names",
    "variants",
]
