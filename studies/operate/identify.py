"""Identification by profile, by silhouette and by both, for several settings and fleets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.infrared.imager import Imager
from studies.operate.fleets import bootstrap_places, fleet_order, fleet_shares, views_of_ships
from studies.operate.matching import joint_evidence, over_places, relative_densities
from studies.operate.profiles import ProfileMatch
from studies.operate.silhouettes import SilhouetteMatch
from studies.operate.survey import PLACES, random_views

CHANNELS = ("profile", "silhouette", "both")
LEFT_OUT = 8
"""Views of a ship that are neither learned nor tested."""
CALIBRATION = 96
"""Views of all ships from which the match of silhouettes is calibrated, or the next more."""


@dataclass(frozen=True)
class Trial:
    """What is tested, and what is known of profiles.

    Attributes
    ----------
    tests, resamples : int
        Views that are identified of any number of ships, and resamples of them.
    bin_width : float
        Width of a range bin [m].
    target_free_ifovs : int
        Target-free IFOVs accumulated in a frame.
    gain_sigma, floor_sigma : float
        Prior standard deviations of gain and noise floor, as of `log_evidence` and `ProfileMatch`.

    See Also
    --------
    identify : Takes it.

    Examples
    --------
    >>> from studies.operate import Trial
    >>> Trial(192, 100, 1.0, 4000, 1.0, 1.0).tests
    192
    """

    tests: int
    resamples: int
    bin_width: float
    target_free_ifovs: int
    gain_sigma: float
    floor_sigma: float


def in_order(
    arrays: NDArray[Any], ship: Sequence[Any], learned: int, tests: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the templates and the tests of all ships, in the order of `fleet_order`.

    Parameters
    ----------
    arrays : (ship, view, ...) ndarray
        Something of every view, templates first.
    ship : sequence
        Names of the ships.
    learned : int
        Number of templates of a ship.
    tests : int
        As of `views_of_ships`.

    Returns
    -------
    (ship, template, ...) ndarray
        Templates.
    (test, ...) ndarray
        Tests, ship by ship.
    """
    rows = views_of_ships(tests, len(ship))
    ships = [arrays[k] for k in fleet_order([str(one) for one in ship])]
    of_tests = [one[learned : learned + number] for one, number in zip(ships, rows, strict=True)]
    return np.stack([one[:learned] for one in ships]), np.concatenate(of_tests)


def planned_views(
    aspect: Sequence[float], tests: int, rng: np.random.Generator
) -> dict[str, NDArray[np.float64]]:
    """Return the views of a ship: templates, random ones to identify, and `LEFT_OUT` others.

    Parameters
    ----------
    aspect : sequence of float
        Aspects of the templates [deg], which have the places `PLACES` in turn.
    tests : int
        As of `views_of_ships`; there are as many random views to identify as a first ship has. All
        lie between the ends of the aspects.
    rng : numpy.random.Generator
        Draws the random views.

    Returns
    -------
    dict
        `aspects`, (view,) [deg], and `places`, (view, 2), as of `seen_views`.

    See Also
    --------
    draw_views, seen_views : Draw them.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.operate import planned_views
    >>> planned_views([0, 45, 90], 40, np.random.default_rng(0))["places"].shape
    (21, 2)
    """
    most = views_of_ships(tests, 1)[0] + LEFT_OUT
    drawn, places = random_views(min(aspect), max(aspect), most, rng)
    learned = np.resize(PLACES, (len(aspect), 2))
    return {
        "aspects": np.concatenate([aspect, drawn]),
        "places": np.concatenate([learned, places]),
    }


def packed(shown: NDArray[np.bool_]) -> dict[str, NDArray[Any]]:
    """Return silhouettes as `match_silhouettes` takes them, a bit for a pixel.

    Parameters
    ----------
    shown : (view, row, column) bool ndarray
        As of `silhouettes`.

    Returns
    -------
    dict
        `shown`, (view, byte), and `shape`, (2,), of a window.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.operate import packed
    >>> packed(np.ones((2, 3, 4), bool))["shown"].shape
    (2, 2)
    """
    bits = np.packbits(shown.reshape(len(shown), -1), axis=1)
    return {"shown": bits, "shape": np.array(shown.shape[1:], dtype=np.int32)}


def match_silhouettes(
    shown: Mapping[str, NDArray[Any]],
    ship: Sequence[Any],
    aspect: Sequence[float],
    tests: int,
    rng: np.random.Generator,
) -> SilhouetteMatch:
    """Return the silhouettes of all ships, matched.

    Parameters
    ----------
    shown : mapping
        `shown`, (ship, view, byte), pixels as bits, and `shape`, (ship, 2), of the window.
    ship : sequence
        Names of the ships.
    aspect : sequence of float
        Aspects of the templates [deg], the first views.
    tests : int
        As of `views_of_ships`.
    rng : numpy.random.Generator
        Draws the noise.

    See Also
    --------
    SilhouetteMatch : Does it.
    """
    rows, columns = shown["shape"][0].tolist()
    bits = np.unpackbits(shown["shown"], axis=-1, count=rows * columns).astype(bool)
    images = bits.reshape(*bits.shape[:2], rows, columns)
    each = min(-(-CALIBRATION // len(ship)), LEFT_OUT)
    others = images[fleet_order([str(one) for one in ship]), -each:]
    return SilhouetteMatch(*in_order(images, ship, len(aspect), tests), others, rng)


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
    """Return the share of views identified for several pulses, frames and numbers of ships.

    Parameters
    ----------
    signatures : mapping
        Arrays of `signatures` for each pulse width and ship.
    silhouettes : SilhouetteMatch
        Silhouettes of the same views.
    imager : Imager
        The imager.
    trial : Trial
        What is tested.
    cnr : float
        Carrier-to-noise ratio of a filled IFOV at the slant range, as a power ratio.
    slant_range : float
        Slant range [m].
    pulse_width, frame_count, fleet : sequence
        Pulse widths [s], frames averaged by both sensors, and numbers of ships.
    ship, aspect : sequence
        Names of all ships, and aspects of their templates [deg].
    rng : numpy.random.Generator
        Draws noise and resamples, the same for every setting.
    valid : (ship,) bool ndarray
        Ships that are there.

    Returns
    -------
    dict
        `share`, (pulse, frames, fleet, channel), and `resampled`, with the resamples last; channels
        are those of `CHANNELS`. Both sensors see one view, so their evidence for a template adds,
        that of the silhouette at any place (`over_places`).

    Raises
    ------
    ValueError
        If a ship is not there.

    See Also
    --------
    fleet_shares : The shares of one setting.
    """
    if not valid.all():
        raise ValueError("valid has a ship that failed, but all of the list must be there")
    learned, ships, tests = len(aspect), len(ship), trial.tests
    shape = (ships, views_of_ships(tests, 1)[0], 2, signatures["excess"].shape[-1])
    normals = rng.standard_normal(shape, dtype=np.float32)
    rows = views_of_ships(tests, ships)
    drawn = np.concatenate([own[:number] for own, number in zip(normals, rows, strict=True)])
    places = bootstrap_places(trial.resamples, tests, ships, rng)

    def matched(p: int, width: float) -> ProfileMatch:
        templates, seen = in_order(signatures["excess"][p], ship, learned, tests)
        mean, power = in_order(signatures["power"][p], ship, 1, tests)
        _, ifovs = in_order(signatures["ifovs"][p], ship, 0, tests)
        free = trial.target_free_ifovs + ifovs
        how = {"pulse_width": width, "bin_width": trial.bin_width, "cnr": cnr}
        mean = mean.mean(axis=(0, 1))
        floor_sigma = trial.floor_sigma
        return ProfileMatch(
            templates, seen, power, mean, free, drawn, floor_sigma=floor_sigma, **how
        )

    matches = [matched(p, width) for p, width in enumerate(pulse_width)]
    whole = len(pulse_width), len(frame_count), len(fleet), len(CHANNELS)
    share, resampled = np.empty(whole), np.empty((*whole, trial.resamples))
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
                at = p, f, slice(None), c
                share[at], resampled[at] = fleet_shares(of_ships, tests, fleet, places)
    return {"share": share, "resampled": resampled}
