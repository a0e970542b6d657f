"""The article's Table 5: categories and scores of infrared silhouettes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.features import log_polar, segment
from ncti.infrared import Hits, footprint
from ncti.infrared.imager import Imager
from ncti.infrared.radiometry import IFOV
from studies.reproduction.categories import acn_scores, category_counts, presentation_orders
from studies.reproduction.simulated import Simulated

if TYPE_CHECKING:
    from ncti.render import LineImage

VIGILANCE = 0.87
FRAMES = 16
SMALL_SIGMA = 1e-3  # K, standard deviation at which the matched segmentation is a threshold

Floats = NDArray[np.float64]
Masks = NDArray[np.bool_]


@dataclass(frozen=True)
class Look:
    """A row of Table 5: the slant range [m], and the range [m] that sets its pixel size."""

    slant_range: float
    pixels_of: float


LOOKS = (Look(25e3, 25e3), Look(50e3, 25e3), Look(50e3, 50e3))
"""25 km; 50 km with half pixels, the article's super-resolution; 50 km."""


def silhouette_table(
    images: Mapping[float, Sequence[LineImage]],
    assumed: Mapping[str, Any],
    *,
    places: Sequence[tuple[float, float]],
    ship: NDArray[np.intp],
    aspect: Floats,
    draws: int,
    rng: np.random.Generator,
) -> dict[str, Simulated]:
    """Return Table 5 of the article for views of ships, and `categories5`, its categories (1,).

    `table5` is percent correct by (row, bin), rows as `LOOKS`; `images` are far-field views, ship
    by ship, by slant range [m]; other arguments are those of `profile_tables`.
    """
    learned, tested = places
    # Ranges with equal depressions share views; equal views, pixels and places share targets.
    patches = {
        id(views): [Hits.of(image).patches() for image in views] for views in images.values()
    }
    drawn: dict[Any, Masks] = {}

    def targets(look: Look, place: tuple[float, float]) -> Masks:
        key = id(images[look.slant_range]), look.pixels_of, place
        if key not in drawn:
            side = footprint(look.pixels_of, IFOV)
            covered = [patch.covering(side, place) for patch in patches[key[0]]]
            drawn[key] = _pad_to_one_canvas(
                [patch.target(assumed["coverage_rule"]) for patch in covered]
            )
        return drawn[key]

    imager = Imager(
        **{name: assumed[name] for name in ("coverage_rule", "target_spread", "sea_spread")}
    )
    templates = _map_vectors(targets(LOOKS[0], learned), assumed)
    tests = np.stack(
        [
            _map_vectors(
                _segmented_silhouettes(
                    targets(look, tested), look.slant_range, imager, assumed, draws, rng
                ),
                assumed,
            )
            for look in LOOKS
        ],
        axis=1,
    )
    orders = presentation_orders(assumed["order"], ship, aspect, draws, rng)
    options = {"vigilance": VIGILANCE, "learning_rate": assumed["learning_rate"]}
    scores = acn_scores(
        templates,
        tests,
        orders,
        ship=ship,
        aspect=aspect,
        label_rule=assumed["label_rule"],
        learn_in_test=assumed["learn_in_test"],
        **options,
    )
    counts = category_counts(templates, orders, **options)
    return {
        "table5": Simulated(scores.mean[1:], scores.spread[1:]),
        "categories5": Simulated.of(counts[:, None]),
    }


def _pad_to_one_canvas(targets: Sequence[Masks]) -> Masks:
    """Return (view, row, col) targets, with as much sea as the largest needs."""
    rows, columns = (
        max(sizes) for sizes in zip(*(target.shape for target in targets), strict=True)
    )
    canvas = np.zeros((len(targets), rows, columns), dtype=bool)
    for view, target in zip(canvas, targets, strict=True):
        view[: target.shape[0], : target.shape[1]] = target
    return canvas


def _segmented_silhouettes(
    targets: Masks,
    slant_range: float,
    imager: Imager,
    assumed: Mapping[str, Any],
    draws: int,
    rng: np.random.Generator,
) -> Masks:
    """Return (draw, view, row, col) silhouettes that are segmented from noisy images."""
    contrast, sigmas = imager.contrast(slant_range), imager.sigmas(FRAMES)
    noise = rng.standard_normal((draws, *targets.shape))
    warm = contrast + sigmas["target_sigma"] * noise
    images = np.where(targets, warm, sigmas["sea_sigma"] * noise)
    if assumed["segmentation"] == "matched":
        return segment(images, contrast=contrast, **sigmas)
    threshold_sigmas: dict[str, Any] = {"target_sigma": SMALL_SIGMA, "sea_sigma": SMALL_SIGMA}
    return segment(images, contrast=2.0 * assumed["threshold"] * contrast, **threshold_sigmas)


def _map_vectors(masks: Masks, assumed: Mapping[str, Any]) -> Floats:
    """Return (..., view, feature) log-polar maps of (..., view, row, col) silhouettes."""
    maps = log_polar(
        masks,
        inner_radius=assumed["inner_radius"],
        interpolation=assumed["interpolation"],
        oversample=1,  # a sample at the centre of each cell, as without interpolation
    )
    return maps.reshape(*maps.shape[:-2], -1)
