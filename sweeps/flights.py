"""The flights of a view: recorded, corrected, held against the truth, and seen as profiles."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.irar import (
    Correction,
    Flight,
    Scan,
    Snapshot,
    Window,
    autofocus,
    correct,
    correct_as_printed,
    measured_extent,
    segmented,
    tilts,
)
from ncti.irar.chain import places
from ncti.ladar import RangeExtent
from sweeps.cache import Arrays, StageCache, code_digest
from sweeps.flight_comparison import compared
from sweeps.flight_course import (
    Course,
    profile_of,
    received,
    recorded,
    widened,
    window_of_cell,
)
from sweeps.flight_grid import (
    CORRECTED,
    FLOWN,
    RECORDED,
    Error,
    believed,
    passes,
)
from sweeps.flight_schema import EXACT, RATES, FlightPlan
from sweeps.flight_variables import FLIGHT, KINDS, OF_VIEWS, SOURCES
from sweeps.ladar import bin_centres
from sweeps.stages import View

LEAST_SEEN = 20  # pixels above the threshold that are a ship and no false alarms


def flight_code() -> str:
    """Hash of all code between a ship and what flights measure of it."""
    return code_digest(
        "ncti.checks",
        "ncti.render",
        "ncti.ladar",
        "ncti.infrared",
        "ncti.irar",
        "sweeps.seeds",
        "sweeps.ladar",
        "sweeps.stages",
        "sweeps.flight_grid",
        "sweeps.flight_variables",
        "sweeps.flight_schema",
        "sweeps.flight_course",
        "sweeps.flight_comparison",
        __name__,
    )


def view_flights(view: View) -> Arrays:
    """Everything that flights past a ship at one aspect measure.

    Parameters
    ----------
    view : View
        The ship, the aspect and the plan.

    Returns
    -------
    dict of str to ndarray
        The variables of the store's group `validation`, without the axes of the view; NaN of
        a ship that is not flown past, but for its synthetic signatures.
    """
    plan = view.plan.flights
    assert plan is not None
    lengths = {
        "source": len(SOURCES),
        "down_range": bin_centres(view.plan.ladar).size,
        "row": plan.window.rows,
        "column": plan.window.columns,
        "pulse_width": len(view.plan.pulse_width),
        "kind": len(KINDS),
    }
    axes = (*FLOWN, *RECORDED, *CORRECTED)
    shape = tuple(len(getattr(plan.grid, name)) for name in axes)
    found: Arrays = {}
    for name, dims, *_ in OF_VIEWS:
        tail = tuple(lengths[dim] for dim in dims if dim in lengths)
        found[name] = np.full((*shape, *tail), np.nan, dtype=np.float32)
    for place, cell in zip(np.ndindex(shape), _cells(view, plan), strict=True):
        for name, values in cell.items():
            found[name][place] = values
    order = [axes.index(name) for name in FLIGHT]
    return {
        name: np.transpose(values, (*order, *range(len(order), values.ndim)))
        for name, values in found.items()
    }


def _cells(view: View, plan: FlightPlan) -> Iterable[Arrays]:
    """What is measured in every cell, the last of the axes fastest; images in the whole window."""
    grid = plan.grid
    draws = list(product(*(getattr(grid, name) for name in RECORDED)))
    choices = list(product(*(getattr(grid, name) for name in CORRECTED)))
    flown = view.ship.label in plan.flown
    for values in passes(grid):
        course = Course(view, plan, values)
        for draw in draws:
            record = _Record(course, dict(zip(RECORDED, draw, strict=True)))
            known = course.signatures(record.replicate)
            for choice in choices:
                cell = record.corrected(_Choice(*choice)) if flown else {}
                measured = cell.get("signature", np.full_like(known["learned"], np.nan))
                kinds = (known["learned"], known["test"], measured)
                yield cell | {"signature": np.stack(kinds, axis=1)}


@dataclass(frozen=True)
class _Choice:
    """How a scan is corrected, as of `CORRECTED`."""

    error: Error
    autofocus: bool
    chain: str
    azimuth: str
    mirror: str
    range_filter: str

    def image(
        self, scan: Scan, *, belief: Flight, window: Window, overscanned: bool = False
    ) -> Snapshot:
        """A scan corrected; rows as printed are a pixel apart."""
        if self.chain != EXACT:
            return correct_as_printed(scan, belief=belief, window=window, rate=RATES[self.chain])
        how = self.correction
        return correct(scan, how, belief=belief, window=window, overscanned=overscanned)

    @property
    def correction(self) -> Correction:
        """By the exact chain."""
        return Correction(azimuth=self.azimuth, mirror=self.mirror, range_filter=self.range_filter)

    def places(
        self, scan: Scan, *, belief: Flight, window: Window
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Where an image has its samples; None as printed, which averages them before."""
        if self.chain != EXACT:
            return None
        row, column, _ = places(scan, self.correction, belief=belief)
        return row - window.bottom, column - window.left


@dataclass(frozen=True)
class _Record:
    """One draw of the noise of a pass, and what each way to correct it gives."""

    course: Course
    values: dict[str, Any]
    beliefs: dict[tuple[Error, bool], Flight] = field(default_factory=dict)

    def corrected(self, choice: _Choice) -> Arrays:
        """The variables of one cell, but for its synthetic signatures; images as stored."""
        course = self.course
        inputs = {
            **course.inputs(),
            "engine": course.view.plan.render.engine,
            "flight": course.values,
            "record": self.values,
            "threshold": course.plan.config.segmentation_threshold,
            "choice": [getattr(choice, name) for name in CORRECTED],
        }
        found = StageCache(course.view.plan.cache).fetch(
            "flight", inputs, partial(self._correct, choice)
        )
        ours, whole = Window(*found.pop("window").tolist()), course.plan.window
        bottom, left = ours.bottom - whole.bottom, ours.left - whole.left
        for name in ("intensity", "range_image", "infrared_image"):
            placed = np.full((whole.rows, whole.columns), np.nan, dtype=np.float32)
            placed[bottom : bottom + ours.rows, left : left + ours.columns] = found[name]
            found[name] = placed
        return found

    @property
    def replicate(self) -> int:
        """Number of the draw of the noise."""
        return int(self.values["replicate"])

    @cached_property
    def scan(self) -> Scan:
        """The raw images."""
        course = self.course
        flown = course.passed(self.replicate)
        return recorded(flown, name=course.name, values=self.values, seed=course.view.plan.seed)

    @cached_property
    def clean(self) -> Scan:
        """The raw images without noise."""
        return received(self.course.passed(self.replicate), self.values).noiseless()

    def belief(self, choice: _Choice) -> Flight:
        """What the corrections take for the flight."""
        key = choice.error, choice.autofocus
        if key not in self.beliefs:
            belief = believed(self.scan.flight, choice.error)
            if choice.autofocus:
                with suppress(ValueError):  # no ship in the image: navigation is all there is
                    belief = autofocus(self.scan, belief)
            self.beliefs[key] = belief
        return self.beliefs[key]

    def _correct(self, choice: _Choice) -> Arrays:
        course, belief = self.course, self.belief(choice)
        config, ladar, flight = course.plan.config, course.view.plan.ladar, self.scan.flight
        window = window_of_cell(
            *(course.mesh, course.flight, choice.error, choice.chain),
            *(choice.azimuth, choice.mirror),
        )
        shown = partial(choice.image, belief=belief, window=window)
        cut = partial(segmented, flight=belief, threshold=config.segmentation_threshold)
        whole = shown(self.scan)
        image, fine = cut(whole), cut(shown(self.scan, overscanned=True))
        # Of the uncut image, if it shows a ship: a threshold eats into dim edges.
        seen = whole.intensity * (np.count_nonzero(image.intensity) >= LEAST_SEEN)
        truths = [
            widened(course.truth, values, window)
            for values in (course.truth.intensity, course.truth.infrared)
        ]
        spots = partial(choice.places, belief=belief, window=window)
        lean = tilts([seen, whole.infrared], truths, places=spots(self.scan))
        clean_lean = tilts(shown(self.clean).infrared, truths[1], places=spots(self.clean))
        profiles = np.stack([profile_of(fine, belief, ladar), *(flight.cnr * course.models)])
        return {
            "profile": profiles.astype(np.float32),
            "mast_tilt": np.array(lean.mast),
            "waterline_tilt": np.array(lean.waterline),
            "mast_tilt_error": np.array(lean.mast_error),
            "waterline_tilt_error": np.array(lean.waterline_error),
            "noiseless_mast_tilt": np.array(clean_lean.mast),
            "noiseless_waterline_tilt": np.array(clean_lean.waterline),
            "closing_speed_error": np.array(belief.closing_speed / flight.closing_speed - 1),
            "looks": image.looks.sum() / max(np.count_nonzero(image.looks), 1),
            "window": np.array([window.bottom, window.left, window.rows, window.columns]),
            "intensity": image.intensity.astype(np.float32),
            "range_image": (image.range - flight.slant_range).astype(np.float32),
            "infrared_image": image.infrared.astype(np.float32),
            "signature": course.expected(self._extent(fine, belief)),
            **compared(
                profiles,
                bin_centres(ladar),
                aspect=course.view.aspect,
                ship=course.view.ship.label,
            ),
        }

    def _extent(self, image: Snapshot, belief: Flight) -> RangeExtent:
        """What the image shows, for the proposed sensor; nothing of nothing."""
        ladar = self.course.view.plan.ladar
        seen = {
            "slant_range": self.course.plan.config.profile_range * 1e3,
            "ifov": ladar.ifov * 1e-6,
            "bin_width": ladar.bin_width,
        }
        try:
            return measured_extent(image, belief, window=ladar.window, **seen)
        except ValueError:
            bins = bin_centres(ladar)
            nowhere = np.zeros((0, 2), dtype=np.int64)
            return RangeExtent(np.zeros((0, bins.size)), bins, cell=nowhere, **seen)
