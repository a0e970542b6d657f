"""Range profiles of the proposed sensor: of synthetic ships, and of those that flights measured.

The synthetic ones are made by the stages of the laser radar, at the range that measured images
stand in for.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.irar import Flight, measured_extent
from ncti.ladar import RangeExtent, expected_profile
from sweeps.engine.stage import Output, Stage, in_memory, plain, stage
from sweeps.stages.corrections import DIMS, GROUP, STATUS, image_of
from sweeps.stages.flight_geometry import flight_of
from sweeps.stages.flights import Pairs
from sweeps.stages.irar import Irar
from sweeps.stages.ladar import Ladar, averaged, cnr_at_range, expected, extent, ifovs, nowhere
from sweeps.stages.views import IRAR, Grid, Render, image, looks

Arrays = dict[str, NDArray[Any]]

KINDS = ("learned", "test", "measured")
NAMES = {  # a flight has settings of the same words
    Ladar.ifov: "ladar_ifov",
    Ladar.cnr: "ladar_cnr",
    Render.samples: "render_samples",
}

flight_image = in_memory(
    uses=(Grid, Render), reads={"depression": Irar.depression}, name="flight_image"
)(image.function)

flight_cnr = plain(uses=(Ladar,), reads={"range": Irar.profile_range}, name="flight_cnr")(
    cnr_at_range.function
)

flight_extent = stage(
    *extent.outputs,
    uses=(Ladar,),
    reads={"image": "flight_image", "range": Irar.profile_range},
    status=STATUS,
    name="flight_extent",
)(extent.function)

flight_ifovs = in_memory(
    uses=(Ladar,),
    reads={"extent": "flight_extent", "range": Irar.profile_range},
    name="flight_ifovs",
)(ifovs.function)

learned_signature = stage(
    *expected.outputs,
    uses=(Grid, Ladar),
    reads={"ifovs": "flight_ifovs", "cnr_at_range": "flight_cnr"},
    status=STATUS,
    name="learned_signature",
)(expected.function)

test_signature = stage(
    *averaged.outputs,
    uses=(Grid, Ladar),
    reads={
        "ifovs": "flight_ifovs",
        "cnr_at_range": "flight_cnr",
        "frame_count": Irar.profile_frames,
    },
    along=(Irar.profile_frames,),
    noise="flight_signature",
    stream=(Grid.ship, Grid.aspect, Irar.depression, Grid.pulse_width, Grid.replicate),
    status=STATUS,
    name="test_signature",
)(averaged.function)


@stage(
    Output(
        "signature",
        ("kind", "down_range"),
        label="range profile of the proposed sensor, noise floor included",
    ),
    uses=(Grid, Irar, Ladar),
    reads={"ladar_ifov": Ladar.ifov},
    along=(Grid.pulse_width,),
    group=GROUP,
    dims=(*DIMS, "pulse_width"),
    names=NAMES,
    when=looks(IRAR),
    status=STATUS,
)
def signature(
    corrected: Arrays,
    learned_signature: NDArray[np.float32],
    test_signature: NDArray[np.float32],
    course: Pairs | None,
    receivers: Pairs,
    flight_cnr: float,
    aspect: float,
    pulse_width: tuple[float, ...],
    profile_range: float,
    ladar_ifov: float,
    bin_width: float,
    window: float,
    target_free_ifovs: int,
    receiver: str,
    false_alarm: float,
) -> NDArray[np.float32]:
    """(pulse_width, kind, bin): what is learned, what it is tested with, what a flight measured.

    Measured ones are NaN of a ship that is not flown past.
    """
    measured = np.full_like(learned_signature, np.nan)
    if course is not None:
        flight = flight_of(aspect, dict((*course, *receivers)))
        seen = _extent(
            corrected,
            flight,
            slant_range=profile_range * 1e3,
            ifov=ladar_ifov * 1e-6,
            bin_width=bin_width,
            window=window,
        )
        for line, width in zip(measured, pulse_width, strict=True):
            line[:] = expected_profile(
                seen,
                pulse_width=width * 1e-9,
                cnr=flight_cnr,
                target_free_ifovs=target_free_ifovs,
                receiver=receiver,
                false_alarm=false_alarm,
            )
    return np.stack([learned_signature, test_signature, measured], axis=1)


def _extent(corrected: Arrays, flight: Flight, *, window: float, **seen: float) -> RangeExtent:
    """Return what an image shows, for the proposed sensor; nothing of nothing."""
    try:
        return measured_extent(image_of(corrected), flight, window=window, **seen)
    except ValueError:
        return nowhere(window, seen["bin_width"])


@stage(
    Output(
        "kind",
        ("kind",),
        "U8",
        label="synthetic profile learned, synthetic test profile, or measured one",
    ),
    group=GROUP,
    when=looks(IRAR),
    coordinates=True,
)
def signature_kinds() -> NDArray[np.str_]:
    """Return the kinds of signatures."""
    return np.array(KINDS)


STAGES: tuple[Stage, ...] = (
    *(flight_image, flight_cnr, flight_extent, flight_ifovs, learned_signature, test_signature),
    *(signature, signature_kinds),
)
