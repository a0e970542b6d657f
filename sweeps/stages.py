"""The stages of a sweep as plain functions of plain parameters; no dask, no zarr."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

import ncti.ships
from ncti.irar import Window
from ncti.ladar import (
    RangeExtent,
    banded_frame_moments,
    cumulative_average,
    expected_profile,
    range_extent,
    sample_frames,
)
from ncti.render import Lattice, RangeImage, range_image
from ncti.render.flight import depression_angle
from sweeps.cache import Arrays, StageCache, code_digest
from sweeps.flight_schema import FlightPlan
from sweeps.grid import InfraredGrid
from sweeps.ladar import cnr_at, lags
from sweeps.schema import (
    RANGE,
    InfraredConfig,
    LadarConfig,
    RenderConfig,
    SceneConfig,
    SweepConfig,
)
from sweeps.seeds import cell_rng

RENDERING = "rendering"  # among the hashes of code, besides the sensors

Points = tuple[NDArray[np.float64], NDArray[np.float64], float]

FINEST = 0.25  # of the configured pixel: more would not pay for the few samples of a thin pole


@dataclass(frozen=True)
class Ship:
    """A ship of the grid.

    Attributes
    ----------
    label : str
        Its value on the `ship` axis.
    source : str
        Name, or path of a sheet or mesh, that `ncti.ships.load` takes.
    digest : str
        Hash of what its mesh is made from.
    """

    label: str
    source: str
    digest: str


@dataclass(frozen=True)
class ViewPlan:
    """What all views of a sweep have in common, in the units of the configuration."""

    sensors: tuple[str, ...]
    pulse_width: tuple[float, ...]
    frame_count: tuple[int, ...]
    range: tuple[float, ...]
    target_free_ifovs: tuple[int, ...]
    replicate: tuple[int, ...]
    lag: int
    scene: SceneConfig
    render: RenderConfig
    ladar: LadarConfig
    infrared_grid: InfraredGrid
    infrared: InfraredConfig
    seed: int
    cache: Path
    code: Mapping[str, str]
    flights: FlightPlan | None = None

    @classmethod
    def of(
        cls,
        config: SweepConfig,
        *,
        engine: str,
        cache: Path,
        code: Mapping[str, str],
        window: Window | None = None,
    ) -> ViewPlan:
        """The plan of a checked configuration, with the engine that will draw.

        And with the window of images, where ships are flown past.

        The hashes of its code are made once, before any worker starts: a worker may read the
        source after somebody has edited it.
        """
        grid = config.grid.expand()
        return cls(
            sensors=config.sensors,
            pulse_width=grid.pulse_width,
            frame_count=grid.frame_count,
            range=grid.range,
            target_free_ifovs=config.ladar.floor_axis(),
            replicate=grid.replicate,
            lag=lags(config).size,
            scene=config.scene,
            render=replace(config.render, engine=engine),
            ladar=config.ladar,
            infrared_grid=config.infrared.expand(grid),
            infrared=config.infrared,
            seed=config.seed,
            cache=cache,
            code=code,
            flights=FlightPlan.of(config.irar, grid, window) if window else None,
        )


def rendering_code() -> str:
    """Hash of all code between a ship and its range image."""
    return code_digest("ncti.checks", "ncti.render", __name__)


def profile_code() -> str:
    """Hash of all code between a ship and its profiles."""
    return code_digest(
        "ncti.checks", "ncti.render", "ncti.ladar", "sweeps.seeds", "sweeps.ladar", __name__
    )


def depression_at(slant_range: float, scene: SceneConfig) -> float:
    """Depression [deg] at a slant range [km]."""
    if scene.geometry == "fixed":
        return scene.depression
    return depression_angle(
        slant_range * 1e3, altitude=scene.altitude, earth_radius=scene.earth_radius
    )


@lru_cache(maxsize=16)
def load_ship(source: str, digest: str, cache: Path) -> trimesh.Trimesh:
    """Mesh of a ship, kept for this process; refused when its file has changed since its digest."""
    mesh = ncti.ships.load(source, cache=cache / "meshes")
    if mesh.metadata["digest"] != digest:
        raise ValueError(f"{source} was changed while the sweep ran")
    return mesh


def view_profiles(view: View) -> Arrays:
    """Everything the range channel measures of a ship at one aspect.

    Parameters
    ----------
    view : View
        The ship, the aspect and the plan.

    Returns
    -------
    dict of str to ndarray
        expected : (pulse_width, range, target_free_ifovs, bin) float32, Equation C;
        averaged : (pulse_width, replicate, frame_count, range, target_free_ifovs, bin) float32,
        averages of sampled frames; with several lags also covariance : (pulse_width, range,
        target_free_ifovs, lag, bin) float32, of one frame.
    """
    plan = view.plan
    axes = (plan.pulse_width, plan.range, plan.target_free_ifovs, plan.replicate)
    cells = [view.profiles(*cell) for cell in product(*axes)]
    shape = tuple(map(len, axes))
    expected = np.array([cell["expected"] for cell in cells]).reshape(*shape, -1)
    averaged = np.array([cell["averaged"] for cell in cells])
    averaged = averaged.reshape(*shape, *averaged.shape[1:])
    profiles = {
        "expected": expected[:, :, :, 0],
        "averaged": np.moveaxis(averaged, (3, 4), (1, 2)),
    }
    if plan.lag == 1:
        return profiles
    bands = np.array([view.covariance(*cell) for cell in product(*axes[:3])])
    return profiles | {"covariance": bands.reshape(*shape[:3], *bands.shape[1:])}


@dataclass(frozen=True)
class View:
    """One ship at one aspect [deg], for all sensors.

    An image is drawn once a depression, and only when a stage that needs it is not at hand; an
    extent is binned once a range, and only when a profile needs it; and so on.
    """

    ship: Ship
    aspect: float
    plan: ViewPlan
    images: dict[float, RangeImage] = field(default_factory=dict)
    extents: dict[float, RangeExtent] = field(default_factory=dict)
    hits: dict[float, Points] = field(default_factory=dict)

    def profiles(
        self, pulse_width: float, slant_range: float, target_free_ifovs: int, replicate: int
    ) -> Arrays:
        """Expected profile and averages of one pulse width [ns] at one range [km]."""
        ladar = self.plan.ladar
        return StageCache(self.plan.cache).fetch(
            "range_profile",
            {
                "extent": self._extent_inputs(slant_range),
                "ship": self.ship.label,
                "pulse_width": pulse_width,
                "frame_count": self.plan.frame_count,
                "target_free_ifovs": target_free_ifovs,
                "cnr": [ladar.cnr, ladar.cnr_range, ladar.extinction],
                "receiver": [ladar.receiver, ladar.false_alarm],
                "seed": self.plan.seed,
                "replicate": replicate,
            },
            partial(self._make_profiles, pulse_width, slant_range, target_free_ifovs, replicate),
        )

    def _make_profiles(
        self, pulse_width: float, slant_range: float, target_free_ifovs: int, replicate: int
    ) -> Arrays:
        ladar = self.plan.ladar
        signal: dict[str, Any] = {
            "pulse_width": pulse_width * 1e-9,
            "cnr": cnr_at(slant_range, ladar),
            "target_free_ifovs": target_free_ifovs,
            "receiver": ladar.receiver,
            "false_alarm": ladar.false_alarm,
        }
        extent = self._extent(slant_range)
        rng = cell_rng(
            self.plan.seed,
            stage="range_profile",
            ship=self.ship.label,
            aspect=self.aspect,
            pulse_width=pulse_width,
            range=slant_range,
            target_free_ifovs=target_free_ifovs,
            # The first replicate is what a sweep without replicates draws.
            **({"replicate": replicate} if replicate else {}),
        )
        frames = sample_frames(extent, frame_count=max(self.plan.frame_count), rng=rng, **signal)
        return {
            "expected": expected_profile(extent, **signal).astype(np.float32),
            "averaged": cumulative_average(frames, self.plan.frame_count).astype(np.float32),
        }

    def covariance(
        self, pulse_width: float, slant_range: float, target_free_ifovs: int
    ) -> NDArray[np.float32]:
        """(lag, bin): covariance of one frame of one pulse width [ns] at one range [km]."""
        ladar = self.plan.ladar
        cnr = cnr_at(slant_range, ladar)

        def make() -> Arrays:
            _, band = banded_frame_moments(
                self._extent(slant_range),
                pulse_width=pulse_width * 1e-9,
                cnr=cnr,
                target_free_ifovs=target_free_ifovs,
            )
            return {"band": band.astype(np.float32)}

        inputs = {
            "extent": self._extent_inputs(slant_range),
            "pulse_width": pulse_width,
            "cnr": cnr,
            "target_free_ifovs": target_free_ifovs,
        }
        band = StageCache(self.plan.cache).fetch("covariance", inputs, make)["band"]
        whole = np.zeros((self.plan.lag, band.shape[1]), dtype=np.float32)
        whole[: len(band)] = band
        return whole

    def image_inputs(self, slant_range: float) -> dict[str, Any]:
        """All that the range image depends on, but for its code."""
        return {
            "ship": self.ship.digest,
            "aspect": self.aspect,
            "depression": depression_at(slant_range, self.plan.scene),
            "render": asdict(self.plan.render),
        }

    def points(self, slant_range: float) -> Points:
        """Horizontal and vertical places [m] of all samples on the ship, and their area [m^2]."""
        depression = depression_at(slant_range, self.plan.scene)
        if depression not in self.hits:
            kept = StageCache(self.plan.cache).fetch(
                "hits",
                {"code": self.plan.code[RENDERING], **self.image_inputs(slant_range)},
                partial(self._make_hits, depression),
            )
            pixel, left, bottom = kept["lattice"].tolist()
            lattice = Lattice(pixel, (left, bottom), self.plan.render.roll)
            # Of the flat image: np.nonzero of two axes takes several times as long.
            rows, cols = np.divmod(
                np.flatnonzero(np.unpackbits(kept["bits"])), int(kept["columns"])
            )
            self.hits[depression] = (*lattice.cross_range_at(rows, cols), pixel**2)
        return self.hits[depression]

    def _make_hits(self, depression: float) -> Arrays:
        image = self.image(depression)
        return {
            "bits": np.packbits(image.hit),
            "columns": np.array(image.hit.shape[1]),
            "lattice": np.array([image.pixel, *image.origin]),
        }

    def _extent_inputs(self, slant_range: float) -> dict[str, Any]:
        """All that the range extent depends on."""
        ladar = self.plan.ladar
        return {
            "code": self.plan.code[RANGE],
            **self.image_inputs(slant_range),
            "range": slant_range,
            "ifov": ladar.ifov,
            "bins": [ladar.bin_width, ladar.window],
            "spread": ladar.spread,
            "reflectance": ladar.reflectance,
        }

    def _extent(self, slant_range: float) -> RangeExtent:
        if slant_range not in self.extents:
            ladar = self.plan.ladar
            kept = StageCache(self.plan.cache).fetch(
                "range_extent",
                self._extent_inputs(slant_range),
                partial(self._make_extent, slant_range),
            )
            self.extents[slant_range] = RangeExtent(
                **kept,
                bin_width=ladar.bin_width,
                ifov=ladar.ifov * 1e-6,
                slant_range=slant_range * 1e3,
            )
        return self.extents[slant_range]

    def _make_extent(self, slant_range: float) -> Arrays:
        ladar = self.plan.ladar
        extent = range_extent(
            self.image(depression_at(slant_range, self.plan.scene)),
            slant_range=slant_range * 1e3,
            ifov=ladar.ifov * 1e-6,
            bin_width=ladar.bin_width,
            window=ladar.window,
            spread=ladar.spread,
            reflectance=ladar.reflectance,
        )
        return {
            "fraction": extent.fraction,
            "down_range": extent.down_range,
            "cell": extent.cell,
        }

    def image(self, depression: float) -> RangeImage:
        """The range image at the configured pixel, or a finer one where that has few samples.

        Ends of ships are small: at one pixel for all, they would err several times more than
        broadsides, and it is the ends that tell ships apart.
        """
        if depression not in self.images:
            render = self.plan.render
            image = self._draw(depression, render.pixel)
            samples = int(image.hit.sum())
            if 0 < samples < render.samples:
                finer = max(math.sqrt(samples / render.samples), FINEST)
                image = self._draw(depression, render.pixel * finer)
            self.images[depression] = image
        return self.images[depression]

    def _draw(self, depression: float, pixel: float) -> RangeImage:
        return range_image(
            load_ship(self.ship.source, self.ship.digest, self.plan.cache),
            aspect=self.aspect,
            depression=depression,
            pixel=pixel,
            roll=self.plan.render.roll,
            engine=self.plan.render.engine,
        )
