"""Figures of the page as embedded PNG, each with the source's corresponding figure."""

from __future__ import annotations

import base64
import io
import shlex
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sweeps.report.rows import groups, read

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 100
Draw = Callable[[str, Path], "Figure"]  # of a kind and a store


@dataclass(frozen=True)
class Kind:
    """A kind of figure: groups of a store that it needs, and its texts.

    The first group must have several values of the dimension `swept`, if given.
    """

    needs: tuple[str, ...]
    title: str
    source: str
    alt: str
    swept: str = ""


# Curves of scores are charts of the page itself, so their kinds are not listed.
KINDS = {
    "profiles": Kind(
        ("range_profile",),
        "Range profiles by aspect, by ship and by number of frames",
        "the article's Figures 3 to 5",
        "Range profiles stacked above each other in three panels: one ship from bow to beam, all "
        "ships at one aspect, and averages of several numbers of frames over the expected profile.",
    ),
    "silhouettes": Kind(
        ("infrared",),
        "Infrared images, silhouettes and log-polar maps by range",
        "the article's Figures 6 to 8",
        "Rows of passive infrared images of one ship by range and super-resolution, each with the "
        "silhouette cut out of it and the log-polar map of that.",
    ),
    "profile_formation": Kind(
        ("classification/acn",),
        "Categories formed from range profiles, by ship and aspect",
        "the article's Figure 19",
        "A strip for each ship, coloured by the category that a range profile joined at each "
        "aspect; categories that ships share are marked.",
    ),
    "formation": Kind(
        ("classification/acn_infrared",),
        "Categories formed from silhouettes, by ship and aspect",
        "the article's Figure 20",
        "A strip for each ship, coloured by the category that a silhouette joined at each aspect; "
        "categories that ships share are marked.",
    ),
    "flight": Kind(
        ("validation",),
        "Every stage of the corrections of a simulated flight, beside the truth",
        "the article's Figures 10, 11 and 13",
        "Intensity and range images of one simulated flight: as scanned, segmented, corrected for "
        "motion and for the mirror, and the truth.",
    ),
    "validation": Kind(
        ("validation",),
        "Near-stern profiles of simulated flights beside noiseless and synthetic ones",
        "the article's Figures 14 to 16",
        "Range profiles of simulated flights near the stern beside noiseless and synthetic ones "
        "of the same ship, and of its sister.",
    ),
    "sensitivity": Kind(
        ("validation",),
        "Errors from wrong parameters of simulated flights, with and without autofocus",
        "",
        "Errors of corrected images and profiles against the error of each flight parameter.",
        swept="error",
    ),
    "scan": Kind(
        ("scan", "tables/scan"),
        "A field of regard: detections, identifications and time",
        "the article's Figure 1",
        "A map of the field of regard with ships and decoys detected and identified, a time line "
        "of the sensors, and scores against the settings.",
    ),
    "runtime_vs_error": Kind(
        ("tables/run_time_samplings",),
        "Run time against the error of range extents, by engine",
        "",
        "Median error of range extents against run time of a view, logarithmic, by engine.",
    ),
}


@dataclass(frozen=True)
class Picture:
    """A figure of the page; without `data` it could not be drawn, and `why` says so."""

    kind: str
    title: str
    source: str
    alt: str
    command: str
    data: str = ""
    why: str = ""


def pictures_of(path: Path, store: Any, draw: Draw) -> Iterator[Picture]:
    """Yield the figures for which a store has the groups, as PNG in base64."""
    for kind, one in KINDS.items():
        if _has(store, one):
            drawn, why = _drawn(kind, path, draw)
            named = shlex.quote(path.name)
            command = f"python -m sweeps.report.figures {kind} {named} {kind}.png"
            yield Picture(kind, one.title, one.source, one.alt, command, drawn, why)


def _has(store: Any, kind: Kind) -> bool:
    """Return whether a store has what a kind of figure shows."""
    for group in kind.needs:
        under, _, name = group.rpartition("/")
        if name not in groups(store, under):
            return False
    return not kind.swept or read(store, kind.needs[0]).sizes.get(kind.swept, 1) > 1


def _drawn(kind: str, path: Path, draw: Draw) -> tuple[str, str]:
    """Return the picture, and the reason if there is none."""
    content = io.BytesIO()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of figures too small for their labels
            draw(kind, path).savefig(content, format="png", dpi=DPI)
    # A missing figure does not prevent the page.
    except Exception as error:
        return "", f"{type(error).__name__}: {error}".partition("\n")[0]
    return base64.b64encode(content.getvalue()).decode("ascii"), ""
