"""Range images: what an aircraft's sensor sees of a ship."""

from ncti.render.choice import available_engines, choose_engine, engines, start_engine
from ncti.render.draw import range_image
from ncti.render.engine import Engine, EngineError
from ncti.render.image import Lattice, RangeImage
from ncti.render.lines import LineImage, line_image, refined
from ncti.render.rays import RayHits, cast_rays
from ncti.render.view import ROLL, View

__all__ = [
    "ROLL",
    "Engine",
    "EngineError",
    "Lattice",
    "LineImage",
    "RangeImage",
    "RayHits",
    "View",
    "available_engines",
    "cast_rays",
    "choose_engine",
    "engines",
    "line_image",
    "range_image",
    "refined",
    "start_engine",
]
