"""Visits of the laser radar to detections: identification and rejection."""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import ladar, search
from ncti.features import profile_vector
from ncti.ladar import RangeExtent
from ncti.search import Box
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Output, Stage, Table, in_memory, plain
from sweeps.stages.ladar import Arrays, Floats, Ladar, nowhere
from sweeps.stages.likelihood import Likelihood
from sweeps.stages.scan import GROUP, Target, of_scan, targets_of, view_of
from sweeps.stages.scan_tables import NOWHERE, tabulate
from sweeps.stages.views import SCAN, Grid, looks

if TYPE_CHECKING:
    import trimesh

    from ncti.classify.likelihood import GaussianTemplates

IMPORTS = ("ncti.classify.likelihood",)  # by its stages, when they are called; takes long
FITTED = 8  # classifiers kept, one for each number of IFOVs of a visit
STEP = 1.2  # between these numbers: the noise's variance is taken within a tenth
Flags = NDArray[np.bool_]
Laser = tuple[float, float, float, float]


# Templates of known ships


@of_scan(
    Output("mean", ("down_range",), "f8"),
    Output("band", ("lag", "down_range"), "f8", pad=0),
    Output("ifovs", dtype="i8"),
)
def scan_moments(ifovs: RangeExtent, pulse_width: float, cnr_at_range: float) -> Arrays:
    """Return mean and covariance of one frame of the IFOVs that see a ship, and their number."""
    mean, band = ladar.banded_frame_moments(
        ifovs, pulse_width=pulse_width * 1e-9, cnr=cnr_at_range, target_free_ifovs=0
    )
    return {"mean": mean, "band": band, "ifovs": np.array(len(ifovs.cell))}


@dataclass(frozen=True, eq=False)
class Templates:
    """Every learned view of a range, for visits of any number of IFOVs."""

    mean: Floats  # (template, bin), of the ship's own IFOVs
    band: Floats  # (template, lag, bin)
    ifovs: NDArray[np.integer]  # (template,)
    ship: NDArray[np.integer]  # (template,)
    noise: tuple[Floats, Floats]  # mean and band of one IFOV without target
    nugget: float
    gain_sigma: float
    _fitted: OrderedDict[int, GaussianTemplates] = field(default_factory=OrderedDict)

    def of(self, ifovs: int) -> GaussianTemplates:
        """Return the classifier of frames of so many IFOVs, the ship's among them."""
        if ifovs not in self._fitted:
            from ncti.classify.likelihood import GaussianTemplates

            empty = np.maximum(ifovs - self.ifovs, 0)
            mean = self.mean + empty[:, None] * self.noise[0]
            band = self.band + empty[:, None, None] * self.noise[1]
            known = GaussianTemplates(nugget=self.nugget, gain_sigma=self.gain_sigma)
            self._fitted[ifovs] = known.fit(mean, band, self.ship, floor=mean[:, :1])
            if len(self._fitted) > FITTED:
                self._fitted.popitem(last=False)
        self._fitted.move_to_end(ifovs)
        return self._fitted[ifovs]

    def named(self, frames: Floats, frame_count: int, ifovs: int) -> tuple[Any, Floats]:
        """Return the most probable ships of (visit, bin) averages, and their similarity.

        Similarity is the largest cosine of a profile vector with those of that ship's templates.
        Visits have many numbers of IFOVs: the classifier is that of a number near theirs, whose
        floor their averages are given.
        """
        near = round(STEP ** round(math.log(ifovs, STEP)))
        raised = frames + (near - ifovs) * self.noise[0]
        ship = self.of(near).predict(raised, frame_count)
        cosine = unit(frames) @ unit(self.mean).T
        cosine[ship[:, None] != self.ship] = -1.0
        return ship, cosine.max(axis=1)


def unit(profiles: Floats) -> Floats:
    """Return (profile, bin) profile vectors of length 1; zeros of a profile without a peak."""
    vectors = profile_vector(profiles)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


@in_memory(uses=(Grid, Ladar, Likelihood), gather=(Grid.ship, Grid.aspect), keep=2)
def scan_templates(
    scan_moments: Arrays,
    there: Flags,
    pulse_width: float,
    cnr_at_range: float,
    bin_width: float,
    window: float,
    nugget: float,
    gain_sigma: float,
) -> Templates:
    """Return the templates of all existing views."""
    band = scan_moments["band"][there]
    mean, alone = ladar.banded_frame_moments(
        nowhere(window, bin_width),
        pulse_width=pulse_width * 1e-9,
        cnr=cnr_at_range,
        target_free_ifovs=1,
    )
    lags = max(band.shape[1], len(alone))
    return Templates(
        scan_moments["mean"][there],
        _wide(band, lags),
        scan_moments["ifovs"][there],
        np.nonzero(there)[0],
        (mean, _wide(alone, lags)),
        nugget,
        gain_sigma,
    )


def _wide(band: Floats, lags: int) -> Floats:
    """Return (..., lag, bin) covariances with more lags, zero there."""
    more = [(0, 0)] * (band.ndim - 2) + [(0, lags - band.shape[-2]), (0, 0)]
    return np.pad(band, more)


@plain(uses=(Grid, Ladar))
def scan_laser(pulse_width: float, cnr: float, cnr_range: float, extinction: float) -> Laser:
    """Return pulse width [s], a carrier-to-noise power ratio, its range [m], extinction [dB/m]."""
    return pulse_width * 1e-9, 10 ** (cnr / 10), cnr_range * 1e3, extinction * 1e-3


@of_scan(
    Output("similarity", ("view",), "f8"),
    along=(Grid.frame_count,),
    gather=(Grid.aspect,),
    stream=(Grid.ship, Grid.range),
)
def scan_known(
    scan_templates: Templates,
    mesh: trimesh.Trimesh,
    frame_count: tuple[int, ...],
    aspect: tuple[float, ...],
    scan_reach: tuple[int, int],
    range: float,
    depression: float,
    depth: float,
    scan_drawn: tuple[Any, ...],
    scan_bins: tuple[float, ...],
    scan_laser: Laser,
    detector: int,
    known_views: int,
    rng: np.random.Generator,
) -> Floats:
    """Return the (frame_count, view) similarity of visits to a known ship to its best template.

    Of visits cued by a single pixel, which are the largest, at aspects that no template has.
    """
    whole = search.cue(Box(0, 0, 1, 1), reach=scan_reach, detector=detector)
    ifovs = whole.size[0] * whole.size[1]
    run = []
    # Each view has noise of its own, however many frames the one before it has drawn.
    for noise in rng.spawn(known_views):
        seen = view_of(
            mesh,
            noise,
            aspect,
            depth=depth,
            slant_range=range * 1e3,
            depression=depression,
            most=scan_reach,
            drawn=scan_drawn,
            bins=scan_bins,
        )
        target = Target.of(seen, scan_bins)
        run.append(averages(target.extent, ifovs, scan_laser, frame_count, noise))
    return np.stack(
        [
            scan_templates.named(frames, many, ifovs)[1]
            for many, frames in zip(frame_count, np.swapaxes(run, 0, 1), strict=True)
        ]
    )


# Results of visits


def averages(
    extent: RangeExtent,
    ifovs: int,
    laser: Laser,
    frame_count: tuple[int, ...],
    rng: np.random.Generator,
) -> Floats:
    """Return (frame_count, bin) averages of frames of some IFOVs, those of an extent included.

    Of a `scan_laser`, at the target's own range.
    """
    pulse_width, cnr, cnr_range, extinction = laser
    frames = ladar.frame_blocks(
        extent,
        pulse_width=pulse_width,
        cnr=ladar.carrier_to_noise(
            extent.slant_range, reference=cnr, reference_range=cnr_range, extinction=extinction
        ),
        frame_count=max(frame_count),
        rng=rng,
        target_free_ifovs=ifovs - len(extent.cell),
    )
    return ladar.cumulative_average(frames, frame_count)


@of_scan(
    Output("named", ("detection",), "i4", pad=-2, fill=-2, label="ship predicted by a visit"),
    Output(
        "similarity", ("detection",), pad=np.nan, label="cosine similarity to the nearest profile"
    ),
    group=GROUP,
    along=(Grid.frame_count,),
    gather=(Grid.ship,),
    stream=(Grid.range, Grid.replicate),
)
def scan_visited(
    scan_detected: Arrays,
    scan_target: Arrays,
    scan_decoy: Arrays,
    scan_templates: Templates,
    frame_count: tuple[int, ...],
    scan_bins: tuple[float, ...],
    scan_laser: Laser,
    rng: np.random.Generator,
) -> Arrays:
    """Return the (frame_count, detection) most probable ship of every visit, and its similarity.

    A visit looks at the detected target through its range gate, and at the sea around it.
    """
    targets = targets_of(scan_target, scan_decoy, scan_bins)
    origin = np.stack([scan_detected["column"], scan_detected["row"]], axis=1)
    sea = nowhere(scan_bins[2], scan_bins[1])
    visits = [Box(*edges) for edges in scan_detected["visit"].tolist()]
    shape = len(frame_count), len(visits)
    named, similarity = np.full(shape, NOWHERE), np.full(shape, np.nan)
    run: dict[int, list[tuple[int, Floats]]] = {}  # visits of one number of IFOVs
    sources, noises = scan_detected["source"].tolist(), rng.spawn(len(visits))
    for number, (visit, source, noise) in enumerate(zip(visits, sources, noises, strict=True)):
        seen = sea if source == NOWHERE else targets[source].inside(visit.less(*origin[source]))
        ifovs = visit.size[0] * visit.size[1]
        found = averages(seen, ifovs, scan_laser, frame_count, noise)
        run.setdefault(ifovs, []).append((number, found))
    for ifovs, several in run.items():
        at = [number for number, _ in several]
        for f, many in enumerate(frame_count):
            frames = np.stack([found[f] for _, found in several])
            named[f, at], similarity[f, at] = scan_templates.named(frames, many, ifovs)
    return {"named": named, "similarity": similarity}


SECONDS: dict[str, Any] = {"dtype": "f8", "unit": "s"}


@of_scan(
    Output("least", label="rejection threshold of the similarity"),
    Output("accepted", ("detection",), "i1", pad=-1, label="1 where a visit is accepted as a ship"),
    Output("detected", dtype="i4", label="ships detected"),
    Output("right", dtype="i4", label="ships detected and identified correctly"),
    Output("wrong", dtype="i4", label="ships detected and misidentified"),
    Output("turned_away", dtype="i4", label="ships detected and rejected"),
    Output("decoys", dtype="i4", label="decoys in the field"),
    Output("decoys_detected", dtype="i4", label="decoys detected"),
    Output("decoys_rejected", dtype="i4", label="decoys detected and rejected"),
    Output("false", dtype="i4", label="detections of the sea"),
    Output("false_rejected", dtype="i4", label="detections of the sea that are rejected"),
    Output("imaging", label="time of the imager", **SECONDS),
    Output("slewing", label="time of moves to visits", **SECONDS),
    Output("dwelling", label="time of visits", **SECONDS),
    Output("total", label="time of the search", **SECONDS),
    Output("alone", label="time of the laser radar over the whole field", **SECONDS),
    group=GROUP,
    gather=(Grid.ship,),
)
def scan_found(
    scan_detected: Arrays,
    scan_visited: Arrays,
    scan_known: Floats,
    scan_field: tuple[float, float, float],
    ship: tuple[str, ...],
    frame_count: int,
    lost: float,
    detector: int,
    pulse_rate: float,
    imager_pixels: int,
    imager_frames: int,
    frame_rate: float,
    slew_time: float,
) -> Arrays:
    """Return the counts and times of a search."""
    least = float(np.quantile(scan_known, lost))
    source, named = scan_detected["source"], scan_visited["named"]
    accepted = scan_visited["similarity"] >= least
    of_ship, sea = (source >= 0) & (source < len(ship)), source == NOWHERE
    decoy = source >= len(ship)
    width, height, ifov = scan_field
    sizes = [Box(*edges).size for edges in scan_detected["visit"].tolist()]
    taken = search.schedule(
        [columns * rows // detector**2 for columns, rows in sizes],
        imaging=search.imaging_time(
            width,
            height,
            ifov=ifov,
            pixels=imager_pixels,
            frame_count=imager_frames,
            frame_rate=frame_rate,
            slew_time=slew_time,
        ),
        whole=search.position_count(width, height, element=ifov, detector=detector),
        frame_count=frame_count,
        pulse_rate=pulse_rate,
        slew_time=slew_time,
    )
    right = of_ship & accepted & (named == source)
    counts = {
        "detected": of_ship,
        "right": right,
        "wrong": of_ship & accepted & ~right,
        "turned_away": of_ship & ~accepted,
        "decoys_detected": decoy,
        "decoys_rejected": decoy & ~accepted,
        "false": sea,
        "false_rejected": sea & ~accepted,
    }
    parts = ("imaging", "slewing", "dwelling", "total", "alone")
    return {
        "least": np.array(least),
        "accepted": accepted,
        "decoys": np.array(len(scan_detected["column"]) - len(ship)),
        **{name: np.array(np.count_nonzero(which)) for name, which in counts.items()},
        **{part: np.array(getattr(taken, part)) for part in parts},
    }


def table(scan: Any, choices: Choices) -> Any:
    """Return the scores and times over all draws."""
    return tabulate(scan, ships=len(choices[Grid.ship]))


STAGES: tuple[Stage, ...] = (
    *(scan_laser, scan_moments, scan_templates, scan_known, scan_visited, scan_found),
)
TABLES = (Table("tables/scan", (GROUP,), table, when=looks(SCAN)),)
