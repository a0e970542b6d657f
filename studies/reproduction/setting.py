"""The article's Tables 2 to 5, simulated with one value of each parameter that it leaves open."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ncti.article import SHIPS
from ncti.ladar import spread_place
from ncti.render import line_image
from ncti.render.flight import DEPRESSION, depression_angle
from studies.reproduction.profiles import SLANT_RANGE, profile_tables
from studies.reproduction.silhouettes import LOOKS, silhouette_table
from studies.reproduction.simulated import Simulated

if TYPE_CHECKING:
    import trimesh

    from ncti.render import LineImage

ALTITUDE = 6705.6  # m, 22,000 ft
SPACING = 1.0  # m between lines


def reproduce(
    assumed: Mapping[str, Any],
    *,
    aspects: ArrayLike,
    draws: int,
    rng: np.random.Generator,
    view: Callable[[str, float, float], LineImage],
) -> dict[str, Simulated]:
    """Return the article's Tables 2 to 5, simulated with given values of its unstated parameters.

    `assumed` has a value for every name of `PRIORS`; the `aspects` (aspect,) [deg] of the four
    ships serve training, which is noiseless, and test; `view` returns the view of a ship's name, an
    aspect and a depression [deg], as `draw` does. `table2` and `table4` are percent
    correct by (row, bin), rows being training, then 32, 16, 8 and 4 frames; `table3` counts
    categories at 10, 30 and 50 ns; `table5` has rows 25 km, 50 km with half pixels, 50 km;
    `categories5` is (1,). The multilayered network is trained once; the Adaptive Clustering Network
    is too, unless orders are random: then it is trained once per draw.
    """
    angles = np.asarray(aspects, dtype=np.float64)
    ships = [_variant(name, assumed[f"variant_{name}"]) for name in SHIPS]
    place = assumed["place_right"], assumed["place_up"]
    moved = tuple(
        (coordinate + off) % 1.0 for coordinate, off in zip(place, spread_place(1), strict=True)
    )
    depressions = {
        slant_range: DEPRESSION
        if assumed["depression"] == "fixed"
        else depression_angle(slant_range, altitude=ALTITUDE)
        for slant_range in (SLANT_RANGE, *(look.slant_range for look in LOOKS))
    }
    drawn = {
        depression: [view(ship, aspect, depression) for ship in ships for aspect in angles.tolist()]
        for depression in set(depressions.values())
    }
    views: dict[float, Sequence[LineImage]] = {
        slant_range: drawn[depression] for slant_range, depression in depressions.items()
    }
    options: dict[str, Any] = {
        "places": (place, moved if assumed["moved"] else place),
        "ship": np.repeat(np.arange(len(SHIPS)), angles.size),
        "aspect": np.tile(angles, len(SHIPS)),
        "draws": draws,
        "rng": rng,
    }
    profiles = profile_tables(views.pop(SLANT_RANGE), assumed, **options)
    return profiles | silhouette_table(views, assumed, **options)


def draw(mesh: trimesh.Trimesh, aspect: float, depression: float) -> LineImage:
    """Return the far-field view of a ship by lines `SPACING` apart; angles in degrees.

    Against lines four times as dense, profile vectors have a cosine of 0.9995 or more, and one
    pixel in a hundred of a silhouette at 25 km differs: less than between variants of a sheet.
    """
    return line_image(mesh, aspect=aspect, depression=depression, spacing=SPACING)


def _variant(name: str, number: int) -> str:
    """Return the name of a ship's variant; 0 is the sheet itself."""
    return f"{name}@0.{number}" if number else name
