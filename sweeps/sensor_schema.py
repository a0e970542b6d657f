"""What a configuration may say of the two sensors that look from afar."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ncti.features import SEGMENTATION_METHODS
from ncti.features.log_polar import INTERPOLATIONS
from ncti.infrared import (
    CONTRAST_AT_ZERO,
    EXTINCTION,
    IFOV,
    NEDT,
    SPREAD,
    SUPER_RESOLUTIONS,
)
from ncti.ladar import RECEIVERS
from sweeps.errors import ConfigurationError
from sweeps.grid import (
    Grid,
    InfraredGrid,
    between,
    count_axis,
    number_axis,
    one_of,
    word_axis,
)

MOST_DRAWN = 10_000  # target-free IFOVs a frame where no short cut stands in for them

# Of one frame [K]. What the most frames and the recombination of shifted ones leave of it,
# 0.5 / sqrt(10,000), is still no less than the 1e-6 K that matched segmentation can tell from 0.
LEAST_NEDT = 1e-3
MOST_FRAMES = 10_000

# Patches of ship are counted, so a pixel that the ship fills may come out a patch or so short of
# 1, by chance: a rule above this share would drop such pixels at random.
MOST_COVERAGE = 0.95


@dataclass
class LadarConfig:
    """The laser radar: its beam, its receiver, its noise."""

    ifov: float = 150.0
    bin_width: float = 1.0
    window: float = 250.0
    spread: float = 0.5
    reflectance: str = "projected_area"
    cnr: float = 32.0
    cnr_range: float = 100.0
    extinction: float = 0.0
    target_free_ifovs: Any = 4000
    receiver: str = "full_profile"
    false_alarm: float = 1e-6

    def __post_init__(self) -> None:
        """Check the ranges."""
        between("ladar.ifov", self.ifov, 1, 100e3)
        between("ladar.bin_width", self.bin_width, 0.05, 50)
        between("ladar.window", self.window, 20, 5000)
        if self.window < 10 * self.bin_width:
            raise ConfigurationError(
                f"ladar.window is {self.window:g} m, but must hold at least 10 bins of "
                f"ladar.bin_width {self.bin_width:g} m"
            )
        between("ladar.spread", self.spread, 0, 1)
        one_of("ladar.reflectance", self.reflectance, ("projected_area", "lambertian"))
        between("ladar.cnr", self.cnr, -100, 100)
        between("ladar.cnr_range", self.cnr_range, 1, 1000)
        between("ladar.extinction", self.extinction, 0, 10)
        one_of("ladar.receiver", self.receiver, RECEIVERS)
        between("ladar.false_alarm", self.false_alarm, 1e-12, 0.5)
        floors = self.floor_axis()
        if self.receiver != "full_profile" and max(floors) > MOST_DRAWN:
            raise ConfigurationError(
                f"ladar.target_free_ifovs has {max(floors)}, but must be at most {MOST_DRAWN} with "
                f"the {self.receiver} receiver, which needs each of them drawn"
            )

    def floor_axis(self) -> tuple[int, ...]:
        """Every value of `target_free_ifovs`, checked."""
        return count_axis(
            "ladar.target_free_ifovs", self.target_free_ifovs, minimum=0, maximum=10**7
        )


@dataclass
class InfraredConfig:
    """The passive-infrared imager: its array, the air, the scene, and what is made of an image."""

    ifov: float = IFOV * 1e6
    contrast_at_zero: float = CONTRAST_AT_ZERO
    extinction: float = EXTINCTION * 1e3
    nedt: float = NEDT
    target_spread: float = SPREAD
    sea_spread: float = SPREAD
    false_alarm: float = 1e-6
    window_length: float = 200.0
    window_height: float = 50.0
    range: Any = None
    frame_count: Any = None
    super_resolution: Any = field(default_factory=lambda: list(SUPER_RESOLUTIONS))
    coverage_rule: Any = 0.25
    segmentation: Any = "matched"
    inner_radius: Any = 0.5
    interpolation: Any = "nearest"
    training_range: float = 25.0
    vigilance: Any = None
    phases: int = 4
    orders: int = 4

    def __post_init__(self) -> None:
        """Check the ranges of what is no axis."""
        between("infrared.ifov", self.ifov, 1, 100e3)
        between("infrared.contrast_at_zero", self.contrast_at_zero, 0, 1000)
        between("infrared.extinction", self.extinction, 0, 10)
        between("infrared.nedt", self.nedt, LEAST_NEDT, 1000)
        between("infrared.target_spread", self.target_spread, 0, 1000)
        between("infrared.sea_spread", self.sea_spread, 0, 1000)
        between("infrared.false_alarm", self.false_alarm, 1e-12, 0.5)
        between("infrared.window_length", self.window_length, 1, 5000)
        between("infrared.window_height", self.window_height, 1, 500)
        between("infrared.training_range", self.training_range, 1, 1000)
        between("infrared.phases", self.phases, 1, 1000)
        between("infrared.orders", self.orders, 1, 1000)

    def expand(self, grid: Grid) -> InfraredGrid:
        """Every value of every axis, checked; what is not given here is the grid's."""
        key = "infrared."
        return InfraredGrid(
            range=grid.range
            if self.range is None
            else number_axis(key + "range", self.range, minimum=1, maximum=1000),
            super_resolution=word_axis(
                key + "super_resolution", self.super_resolution, SUPER_RESOLUTIONS
            ),
            frame_count=grid.frame_count
            if self.frame_count is None
            else count_axis(key + "frame_count", self.frame_count, maximum=MOST_FRAMES),
            coverage_rule=number_axis(
                key + "coverage_rule", self.coverage_rule, minimum=0.01, maximum=MOST_COVERAGE
            ),
            segmentation=word_axis(key + "segmentation", self.segmentation, SEGMENTATION_METHODS),
            inner_radius=number_axis(
                key + "inner_radius", self.inner_radius, minimum=0.01, maximum=2
            ),
            interpolation=word_axis(key + "interpolation", self.interpolation, INTERPOLATIONS),
            phase=tuple(range(self.phases)),
            order=tuple(range(self.orders)),
            vigilance=grid.vigilance
            if self.vigilance is None
            else number_axis(key + "vigilance", self.vigilance, minimum=0, maximum=1),
        )
