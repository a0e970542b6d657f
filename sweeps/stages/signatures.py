"""Range profiles of the proposed sensor: of synthetic ships, and of those in simulated flights.

The synthetic ones are made by the stages of the laser radar, at the range that measured images
stand in for.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import NothingSeenError
from ncti.irar import measured_extent
from ncti.irar.corrected import image_of
from ncti.ladar import expected_profile, no_return
from sweeps.engine.stage import NOWHERE, Output, Stream, coordinate
from sweeps.stages import ladar, views
from sweeps.stages.irar import FLIGHTS, Irar, flight_of
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import Arrays, Grid, Keywords

KINDS = ("learned", "test", "measured")

flight_images = views.image_stages("flight_image", range=Irar.profile_range, below=Irar.depression)
flight_cnr = replace(ladar.cnr_at_range, name="flight_cnr", reads={"range": Irar.profile_range})
FLIGHT_SIGNAL = ladar.RECEIVED | {"cnr": "flight_cnr"}
FLIGHT_IMAGE = {"image": "flight_image", "slant_range": Irar.profile_range}
flight_extent = replace(ladar.extent, name="flight_extent", reads=ladar.extent.reads | FLIGHT_IMAGE)
flight_ifovs = replace(ladar.ifovs, name="flight_ifovs", reads={"extent": "flight_extent"})
learned_signature = replace(
    ladar.expected,
    name="learned_signature",
    reads=FLIGHT_SIGNAL | {"extent": "flight_ifovs"},
    group=NOWHERE,
)
DRAWN = (Grid.ship, Grid.aspect, Irar.depression, Grid.pulse_width, Grid.replicate)
test_signature = replace(
    ladar.averaged,
    name="test_signature",
    reads=FLIGHT_SIGNAL | {"ifovs": "flight_ifovs", "frame_count": Irar.profile_frames},
    along=(Irar.profile_frames,),
    stream=Stream(DRAWN, "flight_signature"),
    group=NOWHERE,
)


@FLIGHTS.stage(
    Output("signature", ("kind", "down_range"), label="range profile, noise floor included"),
    uses=(Grid, Irar, Ladar),
    reads={"ladar_ifov": Ladar.ifov, **FLIGHT_SIGNAL},
    along=(Grid.pulse_width,),
)
def signature(
    corrected: Arrays,
    learned_signature: NDArray[np.float32],
    test_signature: NDArray[np.float32],
    course: Keywords | None,
    receivers: Keywords,
    *,
    aspect: float,
    pulse_width: tuple[float, ...],
    profile_range: float,
    ladar_ifov: float,
    bin_width: float,
    window: float,
    **signal: Any,
) -> NDArray[np.float32]:
    """Return (pulse_width, kind, bin) training, test and measured profiles.

    Measured ones are NaN of a ship that is not flown past.
    """
    measured = np.full_like(learned_signature, np.nan)
    if course is not None:
        flight = flight_of(aspect, dict(course + receivers))
        try:
            seen = measured_extent(
                image_of(corrected),
                flight,
                slant_range=profile_range,
                ifov=ladar_ifov,
                bin_width=bin_width,
                window=window,
            )
        except NothingSeenError:
            seen = no_return(window, bin_width)
        for line, width in zip(measured, pulse_width, strict=True):
            line[:] = expected_profile(seen, pulse_width=width, **signal)
    return np.stack([learned_signature, test_signature, measured], axis=1)


@FLIGHTS.stage(
    coordinate("kind", ("kind",), "U8", "kind of profile; measured: in a simulated flight"),
)
def signature_kinds() -> NDArray[np.str_]:
    """Return the kinds of signatures."""
    return np.array(KINDS)
