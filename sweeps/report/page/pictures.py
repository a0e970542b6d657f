"""Pictures of the page as embedded PNG, each with the article's corresponding figure."""

from __future__ import annotations

import base64
import io
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sweeps.report.stores import groups

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 100


def _profiles(path: Path) -> Figure:
    from sweeps.report.pictures import draw_profiles  # matplotlib is slow to import

    return draw_profiles(path)


def _silhouettes(path: Path) -> Figure:
    from sweeps.report.pictures import draw_silhouettes

    return draw_silhouettes(path)


def _flight(path: Path) -> Figure:
    from sweeps.report.pictures import draw_flights

    return next(iter(draw_flights(path).values()))()


@dataclass(frozen=True)
class Kind:
    """A kind of picture: the group of a store that it shows, the function that draws it, texts."""

    needs: str
    draw: Callable[[Path], Figure]
    title: str
    source: str
    alt: str


KINDS = (
    Kind(
        "range_profile",
        _profiles,
        "Range profiles by aspect, by ship and by number of frames",
        "the article's Figures 3 to 5",
        "Range profiles stacked above each other in three panels: one ship from bow to beam, all "
        "ships at one aspect, and averages of several numbers of frames.",
    ),
    Kind(
        "infrared",
        _silhouettes,
        "Infrared images and log-polar maps by range and super-resolution",
        "the article's Figures 6 to 8",
        "Rows of passive infrared images of one ship by range and super-resolution, each with the "
        "log-polar map of the silhouette cut out of it.",
    ),
    Kind(
        "validation",
        _flight,
        "Every stage of the corrections of a simulated flight, beside the truth",
        "the article's Figures 10, 11 and 13",
        "Intensity and range images of one simulated flight: as scanned, segmented, corrected for "
        "motion and for the mirror, and the truth.",
    ),
)


@dataclass(frozen=True)
class Picture:
    """A picture of the page; without `data` it could not be drawn, and `why` says so."""

    title: str
    source: str
    alt: str
    data: str = ""
    why: str = ""


def pictures_of(path: Path, store: Any, kinds: tuple[Kind, ...] = KINDS) -> Iterator[Picture]:
    """Yield the pictures for which a store has the groups, as PNG in base64."""
    for kind in kinds:
        if kind.needs in groups(store):
            drawn, why = _drawn(kind, path)
            yield Picture(kind.title, kind.source, kind.alt, drawn, why)


def _drawn(kind: Kind, path: Path) -> tuple[str, str]:
    """Return the picture, and the reason if there is none."""
    content = io.BytesIO()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of figures too small for their labels
            kind.draw(path).savefig(content, format="png", dpi=DPI)
    # A missing picture does not prevent the page.
    except Exception as error:
        return "", f"{type(error).__name__}: {error}".partition("\n")[0]
    return base64.b64encode(content.getvalue()).decode("ascii"), ""
