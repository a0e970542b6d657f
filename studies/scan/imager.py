"""The imager of a search: where targets lie in the field, and what is detected of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ncti import infrared
from studies.scan.field import Box, Field, Pixels, cue, detect, thermal_field
from studies.scan.targets import Survey, Target, owner


@dataclass(frozen=True)
class Imager(infrared.Imager):
    """The passive-infrared imager of a search.

    Attributes
    ----------
    false_alarm : float
        False-alarm probability of one pixel of sea.
    frame_count : int
        Frames averaged.

    See Also
    --------
    ncti.infrared.Imager : Its other attributes.
    observe : What it detects.

    Examples
    --------
    >>> from studies.scan import Imager
    >>> imager = Imager(0.25, 2.1585, 0.181e-3, 0.5, 0.5, 0.5, 1e-6, 16)
    >>> print(f"{imager.contrast(100e3):.2f} K")
    0.27 K
    """

    false_alarm: float
    frame_count: int

    def detection_probability(self, pixels: int, contrast: float) -> float:
        """Return the probability that a target of some pixels and contrast [K] is detected."""
        return infrared.detection_probability(
            pixels,
            contrast=contrast,
            false_alarm=self.false_alarm,
            **self.sigmas(self.frame_count),
        )


def places(
    field: Field,
    targets: Sequence[Target],
    survey: Survey,
    *,
    rng: np.random.Generator,
) -> Pixels:
    """Return where targets lie in a field, each in a slot of bearings of its own.

    Slots are in random order, with as much sea between targets that no ship reaches across.

    Parameters
    ----------
    field : Field
        Field of regard.
    targets : sequence of Target
        Ships and decoys.
    survey : Survey
        What they have in common.
    rng : numpy.random.Generator
        Draws the order of the slots.

    Returns
    -------
    (target, 2) int64 ndarray
        Column and row of the pixel corner at each target's origin.

    See Also
    --------
    observe : Detections in the field.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.scan import Field, Survey, box, places
    >>> from ncti.render import Sampling
    >>> survey = Survey(
    ...     slant_range=50e3, depression=3.84, depth=0.05, length=200.0, height=50.0, ifov=150e-6,
    ...     bin_width=1.0, window=250.0, spread=0.5, sampling=Sampling("lines", 1.0, 0, 30.0))
    >>> rng = np.random.default_rng(0)
    >>> barge = survey.target(box(120.0, 20.0, 8.0), (0.0, 90.0), rng)
    >>> field = Field(width=0.05, height=0.03, ifov=150e-6)
    >>> places(field, [barge], survey, rng=rng).shape
    (1, 2)
    """
    slot = field.width / max(len(targets), 1)
    free = slot / 2 - survey.length / survey.slant_range
    return np.array(
        [
            field.pixel(
                (turn + 0.5) * slot - field.width / 2 + free * target.offset,
                survey.elevation(target.extent.slant_range),
            )
            for turn, target in zip(rng.permutation(len(targets)).tolist(), targets, strict=True)
        ],
        dtype=np.int64,
    ).reshape(-1, 2)


def observe(
    field: Field,
    targets: Sequence[Target],
    survey: Survey,
    imager: Imager,
    *,
    detector: int,
    rng: np.random.Generator,
) -> dict[str, NDArray[np.generic]]:
    """Return what the imager detects in a field, and what the laser radar should visit.

    Parameters
    ----------
    field : Field
        Field of regard.
    targets : sequence of Target
        Ships and decoys in it.
    survey : Survey
        What they have in common.
    imager : Imager
        The imager.
    detector : int
        As of `cue`.
    rng : numpy.random.Generator
        Draws the places of targets, then the noise of the image.

    Returns
    -------
    dict of str to ndarray
        column, row : (target,), position of each target's origin, as of `places`; true_aspect,
        slant_range : (target,) [deg, m]; shown, hot : (target,), pixels that show each, and those
        above the threshold;
        detection_probability : (target,), in closed form; alarms : (), pixels of sea above the
        threshold; source : (detection,), target of each detection, -1 for the sea; box, visit :
        (detection, 4), pixels of the detection, and of the visit to it.

    See Also
    --------
    detect, cue : Detections and visits.

    Examples
    --------
    An empty field without false alarms:

    >>> import numpy as np
    >>> from ncti.render import Sampling
    >>> from studies.scan import Field, Imager, Survey, observe
    >>> survey = Survey(
    ...     slant_range=50e3, depression=3.84, depth=0.05, length=60.0, height=20.0, ifov=150e-6,
    ...     bin_width=1.0, window=250.0, spread=0.5, sampling=Sampling("lines", 1.0, 0, 30.0))
    >>> imager = Imager(0.25, 2.1585, 0.181e-3, 0.5, 0.5, 0.5, 1e-12, 16)
    >>> field, rng = Field(width=0.003, height=0.0015, ifov=150e-6), np.random.default_rng(0)
    >>> found = observe(field, [], survey, imager, detector=2, rng=rng)
    >>> found["box"].shape, int(found["alarms"])
    ((0, 4), 0)
    """
    origins = places(field, targets, survey, rng=rng)
    shown, contrasts, probabilities = [], [], []
    for target, origin in zip(targets, origins, strict=True):
        pixels = target.shown(imager.coverage_rule) + origin
        shown.append(pixels[field.box.holds(pixels)])
        contrasts.append(imager.contrast(target.extent.slant_range))
        probabilities.append(imager.detection_probability(len(shown[-1]), contrasts[-1]))
    image = thermal_field(
        field,
        shown,
        contrasts,
        frame_count=imager.frame_count,
        rng=rng,
        nedt=imager.nedt,
        target_spread=imager.target_spread,
        sea_spread=imager.sea_spread,
    )
    threshold = infrared.detection_threshold(
        false_alarm=imager.false_alarm, sigma=imager.sigmas(imager.frame_count)["sea_sigma"]
    )
    detections = detect(image, threshold=threshold, reach=survey.reach)
    owners = np.full(field.shape, -1)
    for number, pixels in enumerate(shown):
        owners[pixels[:, 1], pixels[:, 0]] = number
    hot = np.bincount(owners[image > threshold] + 1, minlength=len(targets) + 1)
    boxes = [detection.box for detection in detections]
    visits = [cue(box, reach=survey.reach, detector=detector) for box in boxes]
    return {
        "column": origins[:, 0],
        "row": origins[:, 1],
        "true_aspect": np.array([target.aspect for target in targets]),
        "slant_range": np.array([target.extent.slant_range for target in targets]),
        "shown": np.array([len(pixels) for pixels in shown]),
        "hot": hot[1:],
        "detection_probability": np.array(probabilities),
        "alarms": hot[0],
        "source": np.array([owner(detection.pixel, owners) for detection in detections], dtype=int),
        "box": _edges(boxes),
        "visit": _edges(visits),
    }


def _edges(boxes: Sequence[Box]) -> NDArray[np.int64]:
    """Return (box, 4) edges."""
    return np.array(boxes, dtype=int).reshape(-1, 4)
