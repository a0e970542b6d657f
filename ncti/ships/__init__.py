"""Ships: from a sheet, or a user's own mesh, to one watertight solid above the waterline."""

from ncti.ships.errors import ShipError
from ncti.ships.loading import Description, describe, digest, load, names
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
]
