"""Visits of the laser radar to detections: identification, rejection, and their outcome."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.features import profile_vector
from ncti.ladar import RangeExtent, banded_frame_moments, carrier_to_noise, no_return
from ncti.ladar.frames import averaged_frames
from studies.scan.field import Box, Field, cue
from studies.scan.schedule import Rates
from studies.scan.targets import Survey, Target

if TYPE_CHECKING:
    import trimesh

    from ncti.classify.likelihood import GaussianTemplates

CACHED_CLASSIFIERS = 8  # classifiers kept, one for each number of IFOVs of a visit
IFOV_STEP = 1.2  # ratio of successive numbers of IFOVs: keeps the noise variance within a tenth

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Laser:
    """The laser radar of a search.

    `pulse_width` [s] is full width at 1/e^2; `cnr` [dB] that of a filled IFOV at `cnr_range` [m];
    `extinction` [dB/m] of the air, one way; `detector` counts elements along a side.
    """

    pulse_width: float
    cnr: float
    cnr_range: float
    extinction: float
    detector: int

    def averages(
        self,
        extent: RangeExtent,
        ifovs: int,
        frame_count: tuple[int, ...],
        rng: np.random.Generator,
    ) -> Floats:
        """Return (frame_count, bin) averages of frames of `ifovs` IFOVs, with those of `extent`.

        The carrier-to-noise ratio is that at the slant range of `extent`.
        """
        cnr = carrier_to_noise(
            extent.slant_range,
            reference=10 ** (self.cnr / 10),
            reference_range=self.cnr_range,
            extinction=self.extinction,
        )
        return averaged_frames(
            extent,
            frame_count,
            pulse_width=self.pulse_width,
            cnr=cnr,
            rng=rng,
            target_free_ifovs=ifovs - len(extent.cell),
        )


@dataclass(frozen=True, eq=False)
class VisitTemplates:
    """Every learned view at one range, for visits of any number of IFOVs.

    `mean` (template, bin) and `band` (template, lag, bin), a lower band, are mean and covariance of
    one frame of the ship's `ifovs` (template,), and `noise`, (bin,) and (lag, bin), those of an
    IFOV without target; `ship` (template,) are indices of ships.
    """

    mean: Floats
    band: Floats
    ifovs: NDArray[np.integer]
    ship: NDArray[np.integer]
    noise: tuple[Floats, Floats]
    diagonal_loading: float
    gain_sigma: float

    @cached_property
    def classifier_of(self) -> Callable[[int], GaussianTemplates]:
        """Function from the number of IFOVs, the ship's included, to a cached classifier."""
        return lru_cache(maxsize=CACHED_CLASSIFIERS)(self._fit_classifier)

    def _fit_classifier(self, ifovs: int) -> GaussianTemplates:
        from ncti.classify.likelihood import GaussianTemplates

        empty = np.maximum(ifovs - self.ifovs, 0)
        mean = self.mean + empty[:, None] * self.noise[0]
        band = self.band + empty[:, None, None] * self.noise[1]
        templates = GaussianTemplates(
            diagonal_loading=self.diagonal_loading, gain_sigma=self.gain_sigma
        )
        return templates.fit(mean, band, self.ship, floor=mean[:, :1])

    def identify(
        self, averages: Floats, frame_count: int, ifovs: int
    ) -> tuple[NDArray[np.integer], Floats]:
        """Return the most probable ships of (visit, bin) averages, and their similarity.

        Similarity is the largest cosine of a profile vector with those of that ship's templates.
        The classifier is fitted for the power of `IFOV_STEP` nearest to the visit's number of
        IFOVs, and averages are shifted to its floor.
        """
        rounded_ifovs = round(IFOV_STEP ** round(math.log(ifovs, IFOV_STEP)))
        shifted = averages + (rounded_ifovs - ifovs) * self.noise[0]
        ship = self.classifier_of(rounded_ifovs).predict(shifted, frame_count)
        cosine = directions(averages) @ directions(self.mean).T
        cosine[ship[:, None] != self.ship] = -1.0
        return ship, cosine.max(axis=1)


def visit_templates(
    moments: Mapping[str, NDArray[Any]],
    valid: NDArray[np.bool_],
    survey: Survey,
    *,
    pulse_width: float,
    cnr: float,
    diagonal_loading: float,
    gain_sigma: float,
) -> VisitTemplates:
    """Return the templates of all valid views at one range.

    `moments` are mean, band and ifovs, each with leading axes (ship, aspect); `valid` marks the
    views that exist. All bands are padded to the same number of lags. Other arguments are those of
    `VisitTemplates` and `Laser`, the carrier-to-noise ratio as a power ratio.
    """
    mean, noise = banded_frame_moments(
        no_return(survey.window, survey.bin_width),
        pulse_width=pulse_width,
        cnr=cnr,
        target_free_ifovs=1,
    )
    band = moments["band"][valid]
    lags = max(band.shape[1], len(noise))
    return VisitTemplates(
        moments["mean"][valid],
        _pad_lags(band, lags),
        moments["ifovs"][valid],
        np.nonzero(valid)[0],
        (mean, _pad_lags(noise, lags)),
        diagonal_loading,
        gain_sigma,
    )


def identify_visits(
    detected: Mapping[str, NDArray[Any]],
    targets: Sequence[Target],
    templates: VisitTemplates,
    survey: Survey,
    laser: Laser,
    *,
    frame_count: tuple[int, ...],
    rng: np.random.Generator,
) -> dict[str, NDArray[Any]]:
    """Return the (frame_count, detection) most probable ships of visits, and their similarity.

    They are `named` and `similarity`, of detections of `observe`. A visit looks at the detected
    target through its range gate, and at the sea around it. Each has its own stream, so that its
    noise does not depend on the others.
    """
    origins = np.stack([detected["column"], detected["row"]], axis=1)
    visits, sources = detected["visit"].tolist(), detected["source"].tolist()
    shape = len(frame_count), len(visits)
    predicted, similarity = np.full(shape, -1), np.full(shape, np.nan)
    by_ifovs: dict[int, list[tuple[int, Floats]]] = {}  # visits of one number of IFOVs
    streams = rng.spawn(len(visits))
    for number, (edges, source, noise) in enumerate(zip(visits, sources, streams, strict=True)):
        visit = Box(*edges)
        ifovs = visit.size[0] * visit.size[1]
        extent = no_return(survey.window, survey.bin_width)
        if source >= 0:
            extent = targets[source].extent_in(visit.relative_to(*origins[source]))
        averages = laser.averages(extent, ifovs, frame_count, noise)
        by_ifovs.setdefault(ifovs, []).append((number, averages))
    for ifovs, group in by_ifovs.items():
        numbers = [number for number, _ in group]
        for f, count in enumerate(frame_count):
            frames = np.stack([averages[f] for _, averages in group])
            predicted[f, numbers], similarity[f, numbers] = templates.identify(frames, count, ifovs)
    return {"named": predicted, "similarity": similarity}


def known_similarity(
    templates: VisitTemplates,
    mesh: trimesh.Trimesh,
    survey: Survey,
    laser: Laser,
    *,
    frame_count: tuple[int, ...],
    aspect: tuple[float, ...],
    known_views: int,
    rng: np.random.Generator,
) -> Floats:
    """Return the (frame_count, view) similarity of visits to a known ship to its best template.

    Visits are cued by a single pixel, which makes them largest, at aspects between templates.
    """
    columns, rows = cue(Box(0, 0, 1, 1), reach=survey.reach, detector=laser.detector).size
    averages = [
        laser.averages(
            survey.target(mesh, aspect, noise).extent, columns * rows, frame_count, noise
        )
        for noise in rng.spawn(known_views)  # a view's noise does not depend on the one before
    ]
    return np.stack(
        [
            templates.identify(frames, count, columns * rows)[1]
            for count, frames in zip(frame_count, np.swapaxes(averages, 0, 1), strict=True)
        ]
    )


def directions(profiles: Floats) -> Floats:
    """Return (profile, bin) profile vectors of length 1; zeros of a profile without a peak."""
    vectors = profile_vector(profiles)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def _pad_lags(band: Floats, lags: int) -> Floats:
    """Return (..., lag, bin) covariances with more lags, zero there."""
    more = [(0, 0)] * (band.ndim - 2) + [(0, lags - band.shape[-2]), (0, 0)]
    return np.pad(band, more)


def outcomes(
    source: NDArray[np.integer],
    named: NDArray[np.integer],
    accepted: NDArray[np.bool_],
    ships: int,
) -> dict[str, NDArray[np.intp]]:
    """Return the counts of a search: ships detected, named right or wrong, decoys and false alarms.

    `source` (detection,) is the target, negative for the sea, and from `ships` on a decoy; `named`
    and `accepted` (detection,) are the ship that the visit named, and whether it was accepted as
    one.
    """
    of_ship, sea, decoy = (source >= 0) & (source < ships), source < 0, source >= ships
    right = of_ship & accepted & (named == source)
    flags = {
        "detected": of_ship,
        "right": right,
        "wrong": of_ship & accepted & ~right,
        "turned_away": of_ship & ~accepted,
        "decoys_detected": decoy,
        "decoys_rejected": decoy & ~accepted,
        "false": sea,
        "false_rejected": sea & ~accepted,
    }
    return {name: np.array(np.count_nonzero(mask)) for name, mask in flags.items()}


def search_outcome(
    detected: Mapping[str, NDArray[Any]],
    visited: Mapping[str, NDArray[Any]],
    known: Floats,
    field: Field,
    rates: Rates,
    *,
    ship: Sequence[str],
    frame_count: int,
    lost: float,
) -> dict[str, Any]:
    """Return the counts and times of a search by name.

    They are the counts of `outcomes`, the times of `Schedule`, and `decoys`, the number of decoys.
    `detected`, `visited` and `known` are results of `observe`, `identify_visits` and
    `known_similarity`. `threshold` is the similarity below which a share `lost` of visits to known
    ships lies; `accepted` are the (detection,) visits that reach it.
    """
    threshold = float(np.quantile(known, lost))
    accepted = visited["similarity"] >= threshold
    visits = [Box(*edges) for edges in detected["visit"].tolist()]
    times = rates.schedule(field, visits, frame_count)
    return {
        "threshold": threshold,
        "accepted": accepted,
        "decoys": len(detected["column"]) - len(ship),
        **outcomes(detected["source"], visited["named"], accepted, len(ship)),
        **vars(times),
        "total": times.total,
    }
