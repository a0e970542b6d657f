"""Ships: from a sheet, or a user's own mesh, to one watertight solid above the waterline."""

from ncti.ships.errors import ShipError
from ncti.ships.loading import digest, load, names, vertices
from ncti.ships.symmetry import is_symmetric

__all__ = ["ShipError", "digest", "is_symmetric", "load", "names", "vertices"]
