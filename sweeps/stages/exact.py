"""Range extents without sampling: the reference that samplings are compared with.

Both are seen from the slant range, so that what differs from them errs by its sampling alone.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import ladar as library
from ncti.ladar import RangeExtent
from sweeps.engine.settings import Settings, count
from sweeps.engine.stage import Output, Stage, in_memory, stage
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import RUN_TIME, SHAPES, STATUS, Grid, Render, looks, quantity

if TYPE_CHECKING:
    import trimesh

Arrays = dict[str, NDArray[Any]]
Floats = NDArray[np.float64]


class RunTime(Settings, key="run_time"):
    """Run time against error."""

    bin_width = quantity(1, 0.05, 50, "m", "range bin of the extents that are timed", shown=True)
    repeats = count(3, 1, 1000, label="timings of a view, of which the median is taken")
    draws = count(16, 1, 1000, label="noisy profiles of a view that are classified", fixed=SHAPES)


of_extents = partial(
    stage,
    uses=(Grid, Render, Ladar, RunTime),
    reads={"bin_width": RunTime.bin_width},
    when=looks(RUN_TIME),
    status=STATUS,
)


# Exact results


@of_extents(
    Output("area", ("ifov", "down_range"), "f8", label="visible area", unit="m2"),
    Output("cell", ("ifov", "side"), "i8", label="column and row of each IFOV"),
)
def exact_extent(
    mesh: trimesh.Trimesh,
    aspect: float,
    depression: float,
    range: float,
    ifov: float,
    bin_width: float,
    window: float,
) -> Arrays:
    """Return the visible areas of the sampling-free reference, bin by range bin."""
    from ncti.ladar.reference import reference_range_extent

    bins = max(1, round(window / bin_width))
    exact = reference_range_extent(
        mesh,
        aspect=aspect,
        depression=depression,
        bin_edges=bin_width * (np.arange(bins + 1, dtype=np.float64) - bins / 2),
        side=ifov * 1e-6 * range * 1e3,
        slant_range=range * 1e3,
    )
    return {"area": exact.area, "cell": exact.cell}


@in_memory(uses=(Grid, Ladar), reads={"bin_width": RunTime.bin_width})
def exact_ifovs(exact_extent: Arrays, range: float, ifov: float, bin_width: float) -> RangeExtent:
    """Return the exact extent as the library has it."""
    area, cell = exact_extent["area"], exact_extent["cell"]
    side, bins = ifov * 1e-6 * range * 1e3, area.shape[1]
    return RangeExtent(
        fraction=area / side**2,
        down_range=bin_width * (np.arange(bins) - (bins - 1) / 2),
        bin_width=bin_width,
        cell=cell,
        ifov=ifov * 1e-6,
        slant_range=range * 1e3,
    )


@of_extents(Output("signature", ("down_range",), "f8", label="expected range profile"))
def exact_signature(
    exact_ifovs: RangeExtent, pulse_width: float, cnr_at_range: float, target_free_ifovs: int
) -> Floats:
    """Return the expected profile of the exact extent."""
    return signature_of(exact_ifovs, pulse_width, cnr_at_range, target_free_ifovs)


@of_extents(
    Output("noise", ("draw", "down_range"), "f8", label="noise of an averaged range profile"),
    stream=(Grid.ship, Grid.aspect, Grid.pulse_width, RunTime.bin_width),
)
def profile_noise(
    exact_ifovs: RangeExtent,
    pulse_width: float,
    frame_count: int,
    cnr_at_range: float,
    target_free_ifovs: int,
    draws: int,
    rng: np.random.Generator,
) -> Floats:
    """Return draws of the deviation of averaged frames from their expectation.

    They are Gaussian, of the exact covariance, and the same for every sampling: answers then change
    by the error of the sampling and by nothing else.
    """
    _, covariance = library.frame_moments(
        exact_ifovs,
        pulse_width=pulse_width * 1e-9,
        cnr=cnr_at_range,
        target_free_ifovs=target_free_ifovs,
        frame_count=frame_count,
    )
    variance, direction = np.linalg.eigh(covariance)
    factor = direction * np.sqrt(np.maximum(variance, 0.0))
    drawn: Floats = rng.standard_normal((draws, len(factor))) @ factor.T
    return drawn


def signature_of(extent: RangeExtent, pulse_width: float, cnr: float, target_free: int) -> Floats:
    """Return the expected profile of an extent by a pulse [ns]."""
    return library.expected_profile(
        extent, pulse_width=pulse_width * 1e-9, cnr=cnr, target_free_ifovs=target_free
    )


SETTINGS: tuple[type[Settings], ...] = (RunTime,)
STAGES: tuple[Stage, ...] = (exact_extent, exact_ifovs, exact_signature, profile_noise)
