"""Range images of ships: by pixels, along lines, or ray by ray."""

from ncti.render.choice import available_engines
from ncti.render.draw import range_image
from ncti.render.draw_lines import line_image, refined
from ncti.render.engine import EngineError
from ncti.render.far_field import drawn_range
from ncti.render.flight import depression_angle
from ncti.render.image import RangeImage
from ncti.render.lines import LineImage
from ncti.render.rays import RayHits, cast_rays
from ncti.render.sampled import Sampling
from ncti.render.view import View, far_field_error

__all__ = [
    "EngineError",
    "LineImage",
    "RangeImage",
    "RayHits",
    "Sampling",
    "View",
    "available_engines",
    "cast_rays",
    "depression_angle",
    "drawn_range",
    "far_field_error",
    "line_image",
    "range_image",
    "refined",
]
