"""One course past a ship: what the beam meets, what a perfect sensor shows, what is learned."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from ncti.irar import (
    Flight,
    Pass,
    Scan,
    Snapshot,
    Window,
    fly,
    profile,
    reflectivity,
    ship_window,
    true_snapshot,
)
from ncti.irar.mirror import MIRROR_FORMS, mirror_rotation
from ncti.ladar import (
    RangeExtent,
    cumulative_average,
    expected_profile,
    range_extent,
    sample_frames,
)
from ncti.render import range_image
from sweeps.cache import Arrays, StageCache
from sweeps.flight_grid import NO_ERROR, Error, parameters, passes
from sweeps.flight_schema import EXACT, FlightConfig, FlightPlan
from sweeps.ladar import bin_centres, cnr_at
from sweeps.schema import IRAR
from sweeps.seeds import cell_rng
from sweeps.sensor_schema import LadarConfig
from sweeps.stages import View, load_ship

CELLS = 8  # of the truth along a pixel; 4 or 10 move tilts of noiseless ships by 0.1 deg

Floats = NDArray[np.float64]


def shared_window(
    config: FlightConfig, hulls: Iterable[trimesh.Trimesh], aspects: tuple[float, ...]
) -> Window:
    """Pixels that hold every corrected image of every ship.

    Parameters
    ----------
    config : FlightConfig
        Checked.
    hulls : iterable of trimesh.Trimesh
        The ships, or what reaches as far.
    aspects : tuple of float
        At which they are seen [deg].
    """
    grid = config.expand()
    windows = [
        window_of_cell(hull, config.flight(aspect, **values), *choice)
        for hull, aspect, values in product(hulls, aspects, passes(grid))
        for choice in product(grid.error, grid.chain, grid.azimuth, grid.mirror)
    ]
    bottom, left = (min(getattr(one, name) for one in windows) for name in ("bottom", "left"))
    top = max(one.bottom + one.rows for one in windows)
    right = max(one.left + one.columns for one in windows)
    return Window(bottom, left, top - bottom, right - left)


def window_of_cell(
    mesh: trimesh.Trimesh, flight: Flight, error: Error, chain: str, azimuth: str, mirror: str
) -> Window:
    """Pixels of a corrected image: about the ship, and wider where it may lean or stretch.

    With an error of the pointing they are where the ship then seems to be: who looks at the
    image sees it there.
    """
    window = ship_window(mesh, flight)
    if error != NO_ERROR or chain != EXACT or azimuth != "pixel" or mirror not in MIRROR_FORMS:
        # Uncorrected lines rise by the mirror's angle, and rows follow one another with the drift.
        lean = abs(
            math.radians(mirror_rotation(flight.depression, mirror_angle=flight.mirror_angle))
        )
        drift, steep = abs(flight.drift / flight.climb), math.tan(lean)
        # As printed, rows that such lines climb more slowly, or faster, keep their distance.
        tall = 1.0 if chain == EXACT else 1.0 / max(1.0 - drift * steep, 0.1)
        above = math.ceil(
            max(window.rows, window.columns) * max(1 / 8, 1.1 * steep)
            + window.rows * 0.6 * (tall - 1.0)
        )
        aside = math.ceil(window.rows * max(1.0, drift + steep) * tall)
        window = Window(
            window.bottom - above,
            window.left - aside,
            window.rows + 2 * above,
            window.columns + 2 * aside,
        )
    if error[0] == "pointing":
        moved = math.radians(error[1]) * math.cos(math.radians(flight.depression)) / flight.ifov
        window = replace(window, left=window.left + round(moved))
    return window


def surface(mesh: trimesh.Trimesh, values: dict[str, Any], reflectance: str) -> dict[str, Any]:
    """How a ship reflects, with the gains put in."""
    gains = {name: values[name] for name in ("transom_gain", "mast_gain")}
    return {
        "reflectivity": reflectivity(mesh, **gains),
        "lambertian": reflectance == "lambertian",
    }


def fly_past(
    mesh: trimesh.Trimesh,
    flight: Flight,
    *,
    name: dict[str, Any],
    replicate: int,
    seed: int,
    reflectance: str,
) -> Pass:
    """A pass by a ship, whose name is its label, its aspect and values on the axes of `FLOWN`."""
    rng = cell_rng(seed, stage="flight_attitude", **name, replicate=replicate)
    return fly(mesh, flight, rng=rng, **surface(mesh, name, reflectance))


def recorded(flown: Pass, *, name: dict[str, Any], values: dict[str, Any], seed: int) -> Scan:
    """Raw images of such a pass, by receivers of values on the axes of `RECORDED`."""
    rng = cell_rng(seed, stage="flight", **name, **values)
    return received(flown, values).record(rng)


def received(flown: Pass, values: dict[str, Any]) -> Pass:
    """The same pass, met by other receivers."""
    flight = replace(flown.plan.flight, **parameters(values))
    return Pass(replace(flown.plan, flight=flight), flown.returns)


@dataclass(frozen=True)
class Course:
    """One geometry: what the beam meets, what a perfect sensor would show, made when asked for."""

    view: View
    plan: FlightPlan
    values: dict[str, Any]
    flown: dict[int, Pass] = field(default_factory=dict)

    @property
    def name(self) -> dict[str, Any]:
        """What names its noise."""
        return {"ship": self.view.ship.label, "aspect": self.view.aspect, **self.values}

    @cached_property
    def flight(self) -> Flight:
        """Of carrier-to-noise ratio 1."""
        return self.plan.config.flight(self.view.aspect, **self.values, cnr=0.0)

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """The ship."""
        ship = self.view.ship
        return load_ship(ship.source, ship.digest, self.view.plan.cache)

    def passed(self, replicate: int) -> Pass:
        """The pass; another one for each replicate where the line of sight jitters."""
        number = replicate if self.values["jitter"] else 0
        if number not in self.flown:
            self.flown.clear()  # only one at a time: each has a million rays
            self.flown[number] = fly_past(
                self.mesh,
                self.flight,
                name=self.name,
                replicate=number,
                seed=self.view.plan.seed,
                reflectance=self.view.plan.ladar.reflectance,
            )
        return self.flown[number]

    @cached_property
    def truth(self) -> Snapshot:
        """The view from the snapshot's place, on the ship's own window."""
        return true_snapshot(
            self.mesh,
            self.flight,
            ship_window(self.mesh, self.flight),
            cells=CELLS,
            **surface(self.mesh, self.values, self.view.plan.ladar.reflectance),
        )

    @cached_property
    def models(self) -> Floats:
        """(noiseless, synthetic, point; bin): profiles without noise, of carrier-to-noise ratio 1.

        The last two are of the whole view's range image at the sensor's pixel, of even
        reflectivity: each pixel's area spread over its range extent, or sampled at its middle.
        Rows of pixels that are level see a deck at distances far apart, so that only the whole
        extent closes the gaps between them.
        """
        plan, flight = self.view.plan, self.flight
        image = range_image(
            self.mesh,
            aspect=self.view.aspect,
            depression=flight.depression,
            pixel=flight.pixel,
            roll=0.0,
            slant_range=flight.slant_range,
            engine=plan.render.engine,
        )
        bins = {"bin_width": plan.ladar.bin_width, "window": plan.ladar.window}
        drawn = [
            range_extent(
                image,
                slant_range=flight.slant_range,
                ifov=flight.ifov * (1 + 1e-9),  # no less than the pixel, whatever the rounding
                spread=spread,
                reflectance=plan.ladar.reflectance,
                **bins,
            ).fraction.sum(axis=0)
            for spread in (1.0, 0.0)
        ]
        return np.stack([profile_of(self.truth, flight, plan.ladar), *drawn])

    def signatures(self, replicate: int) -> Arrays:
        """learned, test : (pulse_width, bin): synthetic profiles of the proposed sensor."""
        plan, config = self.view.plan, self.plan.config
        depression, render = self.values["depression"], plan.render
        inputs = {
            **self.inputs(),
            "depression": depression,
            "render": [render.engine, render.pixel, render.samples, render.roll],
            "frames": config.profile_frames,
            "replicate": replicate,
        }
        return StageCache(plan.cache).fetch(
            "flight_signature", inputs, partial(self._sign, depression, replicate)
        )

    def inputs(self) -> dict[str, Any]:
        """What all that is made of this ship at this aspect depends on."""
        plan, ladar = self.view.plan, self.view.plan.ladar
        return {
            "code": plan.code[IRAR],
            "ship": [self.view.ship.digest, self.view.ship.label],
            "aspect": self.view.aspect,
            "seed": plan.seed,
            "pulse_width": plan.pulse_width,
            "profile_range": self.plan.config.profile_range,
            "ladar": {
                name: getattr(ladar, name)
                for name in (
                    *("ifov", "bin_width", "window", "spread", "reflectance", "cnr", "cnr_range"),
                    *("extinction", "receiver", "false_alarm"),
                )
            },
            "floor": ladar.floor_axis(),
        }

    def _sign(self, depression: float, replicate: int) -> Arrays:
        plan, config = self.view.plan, self.plan.config
        ladar = plan.ladar
        extent = range_extent(
            self.view.image(depression),
            slant_range=config.profile_range * 1e3,
            ifov=ladar.ifov * 1e-6,
            bin_width=ladar.bin_width,
            window=ladar.window,
            spread=ladar.spread,
            reflectance=ladar.reflectance,
        )
        tests = []
        for pulse_width in plan.pulse_width:
            rng = cell_rng(
                plan.seed,
                stage="flight_signature",
                ship=self.view.ship.label,
                aspect=self.view.aspect,
                depression=depression,
                pulse_width=pulse_width,
                replicate=replicate,
            )
            frames = sample_frames(
                extent,
                frame_count=config.profile_frames,
                rng=rng,
                pulse_width=pulse_width * 1e-9,
                **self.receiver,
            )
            tests.append(cumulative_average(frames, (config.profile_frames,))[0])
        return {"learned": self.expected(extent), "test": np.array(tests, dtype=np.float32)}

    @property
    def receiver(self) -> dict[str, Any]:
        """Of the proposed sensor."""
        ladar = self.view.plan.ladar
        return {
            "cnr": cnr_at(self.plan.config.profile_range, ladar),
            "target_free_ifovs": ladar.floor_axis()[0],
            "receiver": ladar.receiver,
            "false_alarm": ladar.false_alarm,
        }

    def expected(self, extent: RangeExtent) -> NDArray[np.float32]:
        """(pulse_width, bin): expected profiles of an extent."""
        return np.array(
            [
                expected_profile(extent, pulse_width=width * 1e-9, **self.receiver)
                for width in self.view.plan.pulse_width
            ],
            dtype=np.float32,
        )


def profile_of(image: Snapshot, flight: Flight, ladar: LadarConfig) -> Floats:
    """(bin,): range profile of a corrected image, on the bins of the sweep."""
    bins = bin_centres(ladar).size
    return profile(image, flight, bins=bins, bin_width=ladar.bin_width)


def widened(truth: Snapshot, values: Floats, window: Window) -> Floats:
    """Values of a truth on its own window, on a larger one whose middle pixels they are."""
    rows, columns = (
        ((larger - own) // 2 * CELLS,) * 2
        for own, larger in (
            (truth.window.rows, window.rows),
            (truth.window.columns, window.columns),
        )
    )
    return np.pad(values, (rows, columns))
