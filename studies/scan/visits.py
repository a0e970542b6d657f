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
from ncti.ladar import (
    RangeExtent,
    banded_frame_moments,
    carrier_to_noise,
    cumulative_average,
    frame_blocks,
    no_return,
)
from studies.scan.field import Box, Field, cue
from studies.scan.schedule import Schedule, imaging_time, position_count, schedule
from studies.scan.targets import Survey, Target

if TYPE_CHECKING:
    import trimesh

    from ncti.classify.likelihood import GaussianTemplates

FITTED = 8  # classifiers kept, one for each number of IFOVs of a visit
STEP = 1.2  # between these numbers: the noise's variance is taken within a tenth

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Laser:
    """The laser radar of a search.

    Attributes
    ----------
    pulse_width : float
        Full width at 1/e^2 [s].
    cnr : float
        Carrier-to-noise ratio of a filled IFOV at `cnr_range` [dB].
    cnr_range : float
        Range at which it is stated [m].
    extinction : float
        Extinction of the air, one way [dB/m].

    See Also
    --------
    VisitTemplates : Names ships by its profiles.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.ladar import no_return
    >>> from studies.scan import Laser
    >>> laser = Laser(pulse_width=30e-9, cnr=32.0, cnr_range=100e3, extinction=0.0)
    >>> sea = no_return(window=250.0, bin_width=1.0)
    >>> laser.averages(sea, 100, (4, 16), np.random.default_rng(0)).shape
    (2, 250)
    """

    pulse_width: float
    cnr: float
    cnr_range: float
    extinction: float

    def averages(
        self,
        extent: RangeExtent,
        ifovs: int,
        frame_count: tuple[int, ...],
        rng: np.random.Generator,
    ) -> Floats:
        """Return (frame_count, bin) averages of frames of some IFOVs, those of an extent included.

        At the target's own range.
        """
        cnr = carrier_to_noise(
            extent.slant_range,
            reference=10 ** (self.cnr / 10),
            reference_range=self.cnr_range,
            extinction=self.extinction,
        )
        frames = frame_blocks(
            extent,
            pulse_width=self.pulse_width,
            cnr=cnr,
            frame_count=max(frame_count),
            rng=rng,
            target_free_ifovs=ifovs - len(extent.cell),
        )
        return cumulative_average(frames, frame_count)


@dataclass(frozen=True, eq=False)
class VisitTemplates:
    """Every learned view of a range, for visits of any number of IFOVs.

    Attributes
    ----------
    mean : (template, bin) float64 ndarray
        Mean of one frame of the ship's own IFOVs.
    band : (template, lag, bin) float64 ndarray
        Its covariance, as a lower band.
    ifovs, ship : (template,) int ndarray
        Number of these IFOVs, and number of the ship.
    noise : (bin,), (lag, bin) float64 ndarray
        Mean and covariance of one IFOV without target.
    diagonal_loading, gain_sigma : float
        As of `ncti.classify.GaussianTemplates`.

    See Also
    --------
    Laser.averages : What is identified.

    Examples
    --------
    >>> from studies.scan import VisitTemplates
    """

    mean: Floats
    band: Floats
    ifovs: NDArray[np.integer]
    ship: NDArray[np.integer]
    noise: tuple[Floats, Floats]
    diagonal_loading: float
    gain_sigma: float

    @cached_property
    def fitted(self) -> Callable[[int], GaussianTemplates]:
        """Classifier of frames of so many IFOVs, the ship's among them; some are kept."""
        return lru_cache(maxsize=FITTED)(self._fit)

    def _fit(self, ifovs: int) -> GaussianTemplates:
        from ncti.classify.likelihood import GaussianTemplates  # takes long

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
        Visits have many numbers of IFOVs: the classifier is that of a number near theirs, whose
        floor their averages are given.
        """
        near = round(STEP ** round(math.log(ifovs, STEP)))
        raised = averages + (near - ifovs) * self.noise[0]
        ship = self.fitted(near).predict(raised, frame_count)
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
    """Return the templates of all existing views of a range.

    `moments` are mean, band and ifovs, each with leading axes (ship, aspect), of which `valid` are
    there; bands, and that of the noise, are filled up to as many lags. Other arguments are as of
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
        _lagged(band, lags),
        moments["ifovs"][valid],
        np.nonzero(valid)[0],
        (mean, _lagged(noise, lags)),
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

    `named` and `similarity`, of detections as of `observe`. A visit looks at the detected target
    through its range gate, and at the sea around it. Each has a stream of its own, so that its
    noise does not depend on the others.
    """
    origins = np.stack([detected["column"], detected["row"]], axis=1)
    visits, sources = detected["visit"].tolist(), detected["source"].tolist()
    shape = len(frame_count), len(visits)
    named, similarity = np.full(shape, -1), np.full(shape, np.nan)
    run: dict[int, list[tuple[int, Floats]]] = {}  # visits of one number of IFOVs
    streams = rng.spawn(len(visits))
    for number, (edges, source, noise) in enumerate(zip(visits, sources, streams, strict=True)):
        visit = Box(*edges)
        ifovs = visit.size[0] * visit.size[1]
        seen = no_return(survey.window, survey.bin_width)
        if source >= 0:
            seen = targets[source].inside(visit.less(*origins[source]))
        averages = laser.averages(seen, ifovs, frame_count, noise)
        run.setdefault(ifovs, []).append((number, averages))
    for ifovs, several in run.items():
        at = [number for number, _ in several]
        for f, count in enumerate(frame_count):
            frames = np.stack([averages[f] for _, averages in several])
            named[f, at], similarity[f, at] = templates.identify(frames, count, ifovs)
    return {"named": named, "similarity": similarity}


def known_similarity(
    templates: VisitTemplates,
    mesh: trimesh.Trimesh,
    survey: Survey,
    laser: Laser,
    *,
    frame_count: tuple[int, ...],
    aspect: tuple[float, ...],
    detector: int,
    known_views: int,
    rng: np.random.Generator,
) -> Floats:
    """Return the (frame_count, view) similarity of visits to a known ship to its best template.

    Of visits cued by a single pixel, which are the largest, at aspects that no template has.
    """
    columns, rows = cue(Box(0, 0, 1, 1), reach=survey.reach, detector=detector).size
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


def _lagged(band: Floats, lags: int) -> Floats:
    """Return (..., lag, bin) covariances with more lags, zero there."""
    more = [(0, 0)] * (band.ndim - 2) + [(0, lags - band.shape[-2]), (0, 0)]
    return np.pad(band, more)


def outcomes(
    source: NDArray[np.integer],
    named: NDArray[np.integer],
    accepted: NDArray[np.bool_],
    ships: int,
) -> dict[str, NDArray[np.intp]]:
    """Return the counts of a search.

    Parameters
    ----------
    source, named : (detection,) int ndarray
        Target of each detection, negative for the sea, and the ship that its visit named.
    accepted : (detection,) bool ndarray
        Whether the visit was accepted as one to a ship.
    ships : int
        Number of ships; targets from this number on are decoys.

    Returns
    -------
    dict of str to () int ndarray
        detected, right, wrong, turned_away, decoys_detected, decoys_rejected, false,
        false_rejected.

    See Also
    --------
    VisitTemplates : Names ships.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.scan import outcomes
    >>> accepted = np.array([True, True, False])
    >>> found = outcomes(np.array([0, 1, -1]), np.array([0, 0, 0]), accepted, ships=2)
    >>> [int(found[name]) for name in ("detected", "right", "wrong", "false_rejected")]
    [2, 1, 1, 1]
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
    return {name: np.array(np.count_nonzero(which)) for name, which in flags.items()}


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
    """Return the counts and times of a search, by name.

    `detected` is as of `observe`, `visited` as of `identify_visits` and `known` as of
    `known_similarity`; `least` is the similarity that a share `lost` of known ships is below, and
    `accepted` the (detection,) visits that reach it. Further names are those of `outcomes` and of
    `Schedule`, and `decoys`.
    """
    least = float(np.quantile(known, lost))
    accepted = visited["similarity"] >= least
    visits = [Box(*edges) for edges in detected["visit"].tolist()]
    times = rates.schedule(field, visits, frame_count)
    return {
        "least": least,
        "accepted": accepted,
        "decoys": len(detected["column"]) - len(ship),
        **outcomes(detected["source"], visited["named"], accepted, len(ship)),
        **vars(times),
        "total": times.total,
    }


@dataclass(frozen=True)
class Rates:
    """Rates of both sensors, and the time that a move takes.

    Attributes
    ----------
    detector : int
        Elements of the laser radar along a side of its detector.
    pulse_rate : float
        Pulses of the laser radar a second, one a frame [Hz].
    imager_pixels : int
        Pixels along a side of the imager's array.
    imager_frames : int
        Frames averaged by the imager.
    frame_rate : float
        Frames of the imager a second [Hz].
    slew_time : float
        Time of a move to a visit, or of the imager's array [s].

    See Also
    --------
    schedule : Times of a search.

    Examples
    --------
    >>> from studies.scan import Box, Field, Rates
    >>> rates = Rates(2, 1000.0, 256, 16, 30.0, 0.1)
    >>> field = Field(width=0.03, height=0.015, ifov=150e-6)
    >>> rates.schedule(field, [Box(0, 0, 20, 10)], 16).dwelling
    0.8
    """

    detector: int
    pulse_rate: float
    imager_pixels: int
    imager_frames: int
    frame_rate: float
    slew_time: float

    def schedule(self, field: Field, visits: Sequence[Box], frame_count: int) -> Schedule:
        """Return the times of a search with some visits of so many frames."""
        sizes = [visit.size for visit in visits]
        return schedule(
            [columns * rows // self.detector**2 for columns, rows in sizes],
            imaging=imaging_time(
                field.width,
                field.height,
                ifov=field.ifov,
                pixels=self.imager_pixels,
                frame_count=self.imager_frames,
                frame_rate=self.frame_rate,
                slew_time=self.slew_time,
            ),
            whole=position_count(
                field.width, field.height, element=field.ifov, detector=self.detector
            ),
            frame_count=frame_count,
            pulse_rate=self.pulse_rate,
            slew_time=self.slew_time,
        )
