"""Identification by profile, by silhouette and by both, for several settings and fleets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.infrared.imager import Imager
from studies.operate.fleets import bootstrap_uniforms, fleet_order, fleet_shares, views_of_ships
from studies.operate.matching import joint_evidence, over_places, relative_densities
from studies.operate.profiles import ProfileMatch, Radar
from studies.operate.silhouettes import SilhouetteMatch
from studies.operate.survey import PLACES, random_views

CHANNELS = ("profile", "silhouette", "both")
LEFT_OUT = 8
"""Views of a ship that are neither learned nor tested."""
CALIBRATION = 96
"""Views that calibrate the match of silhouettes, rounded up to the same number for each ship."""


@dataclass(frozen=True)
class Trial:
    """Size of a test, and prior knowledge of profiles.

    `tests` views of a fleet are identified, and drawn again `resamples` times. `bin_width` [m];
    `target_free_ifovs` add their noise to each frame; `gain_sigma` and `floor_sigma` are the priors
    of `log_evidence` and `ProfileMatch`.
    """

    tests: int
    resamples: int
    bin_width: float
    target_free_ifovs: int
    gain_sigma: float
    floor_sigma: float


def order_ships(
    arrays: NDArray[Any], ship: Sequence[Any], learned: int, tests: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return (ship, template, ...) templates and (test, ...) tests, in the order of `fleet_order`.

    `arrays` (ship, view, ...) holds the `learned` templates first.
    """
    rows = views_of_ships(tests, len(ship))
    ships = [arrays[k] for k in fleet_order([str(name) for name in ship])]
    of_tests = [
        views[learned : learned + number] for views, number in zip(ships, rows, strict=True)
    ]
    return np.stack([views[:learned] for views in ships]), np.concatenate(of_tests)


def planned_views(
    aspect: Sequence[float], tests: int, rng: np.random.Generator
) -> dict[str, NDArray[np.float64]]:
    """Return `aspects` (view,) [deg] and `places` (view, 2) of a ship's views, as of `seen_views`.

    Templates come first, at the given aspects and at `PLACES` in turn, then random views to
    identify between the first and last aspect, then `LEFT_OUT` random ones for calibration.
    """
    most = views_of_ships(tests, 1)[0] + LEFT_OUT
    drawn, places = random_views(min(aspect), max(aspect), most, rng)
    learned = np.resize(PLACES, (len(aspect), 2))
    return {
        "aspects": np.concatenate([aspect, drawn]),
        "places": np.concatenate([learned, places]),
    }


def packed(shown: NDArray[np.bool_]) -> dict[str, NDArray[Any]]:
    """Return silhouettes (view, row, column) as bits, `shown` (view, byte), and their `shape`."""
    bits = np.packbits(shown.reshape(len(shown), -1), axis=1)
    return {"shown": bits, "shape": np.array(shown.shape[1:], dtype=np.int32)}


def match_silhouettes(
    shown: Mapping[str, NDArray[Any]],
    ship: Sequence[Any],
    aspect: Sequence[float],
    tests: int,
    rng: np.random.Generator,
) -> SilhouetteMatch:
    """Return the match of all ships' silhouettes, `packed` as `shown` (ship, view, byte).

    `aspect` are those of the templates, the first views of each ship.
    """
    rows, columns = shown["shape"][0].tolist()
    bits = np.unpackbits(shown["shown"], axis=-1, count=rows * columns).astype(bool)
    images = bits.reshape(*bits.shape[:2], rows, columns)
    count = min(-(-CALIBRATION // len(ship)), LEFT_OUT)
    calibration = images[fleet_order([str(name) for name in ship]), -count:]
    return SilhouetteMatch(*order_ships(images, ship, len(aspect), tests), calibration, rng)


def identify(
    signatures: Mapping[str, NDArray[Any]],
    silhouettes: SilhouetteMatch,
    imager: Imager,
    trial: Trial,
    *,
    cnr: float,
    slant_range: float,
    pulse_width: Sequence[float],
    frame_count: Sequence[int],
    fleet: Sequence[int],
    ship: Sequence[Any],
    aspect: Sequence[float],
    rng: np.random.Generator,
    valid: NDArray[np.bool_],
) -> dict[str, NDArray[np.float64]]:
    """Return the share of views identified, by pulse width, frame count, fleet and channel.

    `share` is (pulse, frames, fleet, channel), and `resampled` has the resamples as its last axis.
    `signatures` are those of every pulse width and ship; `cnr` is a power ratio at `slant_range`
    [m]; `pulse_width` [s]. Noise and resamples are the same for every setting. Both sensors see the
    same view, so their log densities under a template add; the silhouette's density is averaged
    over places (`over_places`).
    """
    if not valid.all():
        raise ValueError("valid has a ship that failed, but all of the list must be there")
    learned, ships, tests = len(aspect), len(ship), trial.tests
    shape = (ships, views_of_ships(tests, 1)[0], 2, signatures["excess"].shape[-1])
    normals = rng.standard_normal(shape, dtype=np.float32)
    rows = views_of_ships(tests, ships)
    drawn = np.concatenate(
        [ship_normals[:number] for ship_normals, number in zip(normals, rows, strict=True)]
    )
    uniforms = bootstrap_uniforms(trial.resamples, tests, ships, rng)

    def match_width(p: int, width: float) -> ProfileMatch:
        templates, profiles = order_ships(signatures["excess"][p], ship, learned, tests)
        mean, power = order_ships(signatures["power"][p], ship, 1, tests)
        _, ifovs = order_ships(signatures["ifovs"][p], ship, 0, tests)
        free = trial.target_free_ifovs + ifovs
        radar = Radar(width, trial.bin_width, cnr)
        mean = mean.mean(axis=(0, 1))
        arguments = templates, profiles, power, mean, free, drawn, radar
        return ProfileMatch(*arguments, floor_sigma=trial.floor_sigma)

    matches = [match_width(p, width) for p, width in enumerate(pulse_width)]
    sizes = len(pulse_width), len(frame_count), len(fleet), len(CHANNELS)
    share, resampled = np.empty(sizes), np.empty((*sizes, trial.resamples))
    gain = {"gain_sigma": trial.gain_sigma}
    for f, frames in enumerate(frame_count):
        silhouette = silhouettes.evidence(frames, imager=imager, slant_range=slant_range, **gain)
        best, density = relative_densities(silhouette, ships)
        of_silhouette = joint_evidence((best, density))
        anywhere = best, over_places(density, len(PLACES))
        for p, match in enumerate(matches):
            profile = relative_densities(match.evidence(frames, **gain), ships)
            of_profile, of_both = joint_evidence(profile), joint_evidence(profile, anywhere)
            for c, of_ships in enumerate((of_profile, of_silhouette, of_both)):
                index = p, f, slice(None), c
                share[index], resampled[index] = fleet_shares(of_ships, tests, fleet, uniforms)
    return {"share": share, "resampled": resampled}
