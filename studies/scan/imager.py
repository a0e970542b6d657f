"""The imager of a search: places of targets in the field, and their detection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ncti import infrared
from studies.scan.field import Box, Field, Pixels, cue, detect, thermal_field
from studies.scan.targets import Survey, Target, owner


@dataclass(frozen=True, kw_only=True)
class Imager(infrared.Imager):
    """The passive-infrared imager of a search, which averages `frame_count` frames.

    `false_alarm` is the probability that one pixel of sea exceeds the threshold.
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
    """Return the (target, 2) column and row of the pixel corner at each target's origin.

    Each target has its own slot of bearings, in random order, with enough sea between targets that
    no ship reaches another.
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
    """Return the imager's detections in a field, and the visits of the laser radar to them.

    Of targets (target,): `column`, `row` of the origin, `true_aspect` [deg], `slant_range` [m], the
    pixels `shown`, those `hot`, above the threshold, and `detection_probability` in closed form.
    `alarms` () counts hot pixels of sea. Of detections (detection,): `source`, the target or -1 for
    the sea; `box` and `visit` (detection, 4), edges of its pixels and of the visit.
    """
    origins = places(field, targets, survey, rng=rng)
    visible, contrasts, probabilities = [], [], []
    for target, origin in zip(targets, origins, strict=True):
        pixels = target.visible_pixels(imager.coverage_rule) + origin
        visible.append(pixels[field.box.holds(pixels)])
        contrasts.append(imager.contrast(target.extent.slant_range))
        probabilities.append(imager.detection_probability(len(visible[-1]), contrasts[-1]))
    image = thermal_field(
        field,
        visible,
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
    for number, pixels in enumerate(visible):
        owners[pixels[:, 1], pixels[:, 0]] = number
    hot = np.bincount(owners[image > threshold] + 1, minlength=len(targets) + 1)
    boxes = [detection.box for detection in detections]
    visits = [cue(box, reach=survey.reach, detector=detector) for box in boxes]
    return {
        "column": origins[:, 0],
        "row": origins[:, 1],
        "true_aspect": np.array([target.aspect for target in targets]),
        "slant_range": np.array([target.extent.slant_range for target in targets]),
        "shown": np.array([len(pixels) for pixels in visible]),
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
