"""The article's Tables 2, 3 and 4: categories and scores of range profiles."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.evaluate import aspect_bins
from ncti.features import profile_vector
from ncti.ladar import (
    RangeExtent,
    banded_frame_moments,
    expected_profile,
    noise_floor,
    power_ratio,
    range_extent,
)
from studies.reproduction.categories import acn_scores, category_counts, presentation_orders
from studies.reproduction.simulated import Simulated, percent_by_bin

if TYPE_CHECKING:
    from ncti.render import LineImage

SLANT_RANGE = 100e3
PULSE_WIDTH = 30e-9
PULSE_WIDTHS = (10e-9, 30e-9, 50e-9)  # of Table 3
FRAMES = (32, 16, 8, 4)  # rows of Tables 2 and 4 below the training
VIGILANCE = 0.95
LOADING = (
    1e-6  # of the variance of a bin: noise is band-limited, so covariances are nearly singular
)

Floats = NDArray[np.float64]


def profile_tables(
    images: Sequence[LineImage],
    assumed: Mapping[str, Any],
    *,
    places: Sequence[tuple[float, float]],
    ship: NDArray[np.intp],
    aspect: Floats,
    draws: int,
    rng: np.random.Generator,
) -> dict[str, Simulated]:
    """Return Tables 2, 3 and 4 of the article for views of ships.

    `table2` and `table4` are percent correct by (row, bin), the first row of the training, others
    by `FRAMES`; `table3` counts categories by pulse width. `images` are far-field views, ship by
    ship, with `ship` (view,) and `aspect` (view,) [deg]; `places` those of the ship origin in an
    IFOV, in training and test [IFOV]. Each draw has its own noise and, if orders are random, its
    own order.
    """
    optics: dict[str, Any] = {"ifov": 1e-6 * assumed["ifov"], "reflectance": assumed["reflectance"]}
    extents = {
        place: [
            range_extent(image, slant_range=SLANT_RANGE, shift=place, **optics) for image in images
        ]
        for place in {*places}
    }
    learned, tested = (extents[place] for place in places)
    cnr, free = power_ratio(assumed["cnr"]), round(assumed["target_free_ifovs"])
    signal: dict[str, Any] = {"cnr": cnr, "target_free_ifovs": free}

    def vectors(profiles: Floats, extents: Sequence[RangeExtent]) -> Floats:
        known = np.array([len(extent.fraction) + free for extent in extents]) * noise_floor()
        return _vectors(profiles, known, assumed["floor"], assumed["normalisation"])

    templates = {
        width: vectors(
            np.array([expected_profile(extent, pulse_width=width, **signal) for extent in learned]),
            learned,
        )
        for width in PULSE_WIDTHS
    }
    averages = np.stack(
        [
            averaged_profiles(
                extent, pulse_width=PULSE_WIDTH, frame_counts=FRAMES, draws=draws, rng=rng, **signal
            )
            for extent in tested
        ],
        axis=2,
    )
    tests = vectors(averages, tested)
    orders = presentation_orders(assumed["order"], ship, aspect, draws, rng)
    options = {"vigilance": VIGILANCE, "learning_rate": assumed["learning_rate"]}
    counts = [category_counts(templates[width], orders, **options) for width in PULSE_WIDTHS]
    table4 = acn_scores(
        templates[PULSE_WIDTH],
        tests,
        orders,
        ship=ship,
        aspect=aspect,
        label_rule=assumed["label_rule"],
        learn_in_test=assumed["learn_in_test"],
        **options,
    )
    table2 = mnn_scores(templates[PULSE_WIDTH], tests, assumed, ship=ship, aspect=aspect, rng=rng)
    return {"table2": table2, "table3": Simulated.of(np.transpose(counts)), "table4": table4}


def averaged_profiles(
    extent: RangeExtent,
    *,
    pulse_width: float,
    cnr: float,
    target_free_ifovs: int,
    frame_counts: Sequence[int],
    draws: int,
    rng: np.random.Generator,
) -> Floats:
    """Return (draw, frame_count, bin) averaged frames, noise floor included, as Gaussian processes.

    `frame_counts` must decrease; averages of one draw share their first frames. Averages have the
    exact mean and covariance of `ncti.ladar.frame_moments`. A frame sums magnitudes over dozens of
    IFOVs, so they are nearly normal, at a tenth of the time of drawing each IFOV. The neglected
    skewness is largest in averages of few frames without target-free IFOVs, where ships are named
    correctly as often (`tests/studies/reproduction`).
    """
    longest = np.array(frame_counts)
    steps = -np.diff([*longest, 0])  # frames of each average that the next one lacks
    from scipy.linalg import cholesky_banded

    mean, band = banded_frame_moments(
        extent, pulse_width=pulse_width, cnr=cnr, target_free_ifovs=target_free_ifovs
    )
    band[0] *= 1.0 + LOADING
    factor = cholesky_banded(band, lower=True)
    normals = rng.standard_normal((draws, len(longest), mean.size))
    noise = factor[0] * normals
    for lag in range(1, len(factor)):
        noise[..., lag:] += (factor[lag] * normals)[..., :-lag]
    sums = np.cumsum((noise * np.sqrt(steps)[:, None])[:, ::-1], axis=1)[:, ::-1]
    return mean + sums / longest[:, None]


def _vectors(profiles: Floats, known: Floats, floor: str, normalisation: str) -> Floats:
    """Return (..., view, bin) vectors of profiles, by estimate of the floor and normalisation."""
    levels = {
        "edges": lambda: None,
        "median": lambda: np.median(profiles, axis=-1),
        "known": lambda: np.broadcast_to(known, profiles.shape[:-1]),
    }
    vectors = profile_vector(profiles, floor=levels[floor]())
    if normalisation == "energy":
        norms = np.linalg.norm(vectors, axis=-1, keepdims=True)
        return vectors / np.where(norms == 0.0, 1.0, norms)
    return vectors


def mnn_scores(
    templates: Floats,
    tests: Floats,
    assumed: Mapping[str, Any],
    *,
    ship: NDArray[np.intp],
    aspect: Floats,
    rng: np.random.Generator,
) -> Simulated:
    """Return the multilayered network's percent correct by (row, bin), training first.

    `templates` (view, bin) are learned, `tests` (draw, frame_count, view, bin) tested. An answer is
    right if both ship and aspect bin are.
    """
    from sklearn.exceptions import ConvergenceWarning

    from ncti.classify import GainAnnealedNetwork

    labels, group = aspect_bins(aspect)
    truth = ship * len(labels) + group
    network = GainAnnealedNetwork(
        tolerance=assumed["mnn_tolerance"],
        epochs=round(assumed["mnn_epochs"]),
        learning_rate=assumed["mnn_learning_rate"],
        annealing=assumed["mnn_annealing"],
        scaling=assumed["mnn_scaling"],
        random_state=int(rng.integers(2**32)),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a short training is one of the values
        network.fit(templates, truth)
    predicted = network.predict(tests.reshape(-1, tests.shape[-1])).reshape(tests.shape[:-1])
    trained = np.broadcast_to(network.predict(templates), (len(tests), 1, len(truth)))
    return Simulated.of(
        percent_by_bin(np.concatenate([trained, predicted], axis=1) == truth, aspect)
    )
