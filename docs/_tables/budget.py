"""The error budget: effect of each approximation on profiles and on identification."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # of scikit-learn

import ncti.ships
from benchmarks.classifiers import FRAMES, SHIPS, SIGNAL, SLANT_RANGE
from benchmarks.reports import Column, Report, Sample
from benchmarks.views import DEPRESSION
from ncti.classify import GaussianTemplates
from ncti.evaluate import aspect_bins
from ncti.ladar import (
    RangeExtent,
    banded_frame_moments,
    cumulative_average,
    range_extent,
    sample_frames,
)
from ncti.ladar.pulse import Pulse, target_kernel
from ncti.render import Sampling, drawn_range, line_image
from ncti.render.choice import choose_engine
from ncti.render.far_field import reach_of
from ncti.render.view import ROLL
from studies.run_time.reference import reference_range_extent
from sweeps.stages.views import Render, image

STEP = 3.0  # between templates [deg]
ASPECTS = tuple(np.arange(0.0, 90.1, STEP).tolist())
TEST_ASPECTS = tuple(np.arange(STEP / 2, 90.0, STEP).tolist())
REFERENCES = tuple(np.arange(0.0, 90.1, 15.0).tolist())  # views of the polygon clipper [deg]
FINE_SPACING = 1 / 16  # distance of the lines that stand for the truth [m]
FINER_BINS = 9  # for one of 1 m; odd, so that one of them has the same centre
REPLICATES = 8
ASPECT_BINS = ("0-27", "30-57", "60-90")

Floats = NDArray[np.float64]
ExtentOf = Callable[[str, float], RangeExtent]
"""Function from a ship's name and an aspect [deg] to a range extent."""


@dataclass(frozen=True)
class Views:
    """Views on which the budget is measured.

    Attributes
    ----------
    ships : tuple of str
        Names.
    aspects, between : tuple of float
        Learned, and between those learned [deg].
    references : tuple of float
        Aspects at which the sampling-free reference is made [deg].
    replicates : int
        Independent averages of every view.
    """

    ships: tuple[str, ...] = SHIPS
    aspects: tuple[float, ...] = ASPECTS
    between: tuple[float, ...] = TEST_ASPECTS
    references: tuple[float, ...] = REFERENCES
    replicates: int = REPLICATES
    _kept: dict[Any, Any] = field(default_factory=dict, repr=False)

    def ship_aspects(self, aspects: Sequence[float]) -> list[tuple[str, float]]:
        """Return ship and aspect of all views, ship by ship."""
        return [(ship, aspect) for ship in self.ships for aspect in aspects]

    def extent(self, extent_of: ExtentOf, ship: str, aspect: float) -> RangeExtent:
        """Return a view's extent, computed once."""
        key = extent_of, ship, aspect
        if key not in self._kept:
            self._kept[key] = extent_of(ship, aspect)
        extent: RangeExtent = self._kept[key]
        return extent

    @cached_property
    def averages(self) -> Floats:
        """(view, replicate, bin) float64 ndarray: averages of views at learned aspects."""
        return self._draw_averages(self.aspects, 0)

    @cached_property
    def averages_between(self) -> Floats:
        """(view, replicate, bin) float64 ndarray: averages of views between them."""
        return self._draw_averages(self.between, 1)

    def _draw_averages(self, aspects: Sequence[float], stream: int) -> Floats:
        drawn = []
        for number, view in enumerate(self.ship_aspects(aspects)):
            rng = np.random.default_rng([stream, number])
            frames = sample_frames(
                self.extent(true_extent, *view),
                frame_count=FRAMES * self.replicates,
                rng=rng,
                **SIGNAL,
            )
            runs = frames.reshape(self.replicates, FRAMES, -1)
            drawn.append([cumulative_average(run, [FRAMES])[0] for run in runs])
        return np.array(drawn)

    def percent_right(
        self, extent_of: ExtentOf, averages: Floats, *, between: bool = False, **learn: Any
    ) -> Floats:
        """Return (replicate, group) percent correct with templates by `extent_of`."""
        learned_views = self.ship_aspects(learn.get("aspects", self.aspects))
        extents = [self.extent(extent_of, *view) for view in learned_views]
        moments = [
            _metre_moments(extent, *banded_frame_moments(extent, **SIGNAL)) for extent in extents
        ]
        means, bands = (np.array(parts) for parts in zip(*moments, strict=True))
        templates = GaussianTemplates().fit(
            means, bands, [ship for ship, _ in learned_views], floor=means[:, :1]
        )
        tested = self.ship_aspects(self.between if between else self.aspects)
        names = templates.predict(averages.reshape(-1, averages.shape[-1]), FRAMES)
        right = names.reshape(averages.shape[:2]) == np.array([ship for ship, _ in tested])[:, None]
        labels, group = aspect_bins(np.array([aspect for _, aspect in tested]))
        return np.array([100 * right[group == k].mean(axis=0) for k in range(len(labels))]).T


def true_extent(ship: str, aspect: float) -> RangeExtent:
    """Return the extent by lines 1/16 m apart, seen from the slant range itself."""
    return _fine_extent(ncti.ships.load(ship), aspect)


def _fine_extent(
    mesh: trimesh.Trimesh,
    aspect: float,
    *,
    view_range: float | None = SLANT_RANGE,
    slant_range: float = SLANT_RANGE,
    bin_width: float = 1.0,
) -> RangeExtent:
    """Return the extent by fine lines of a view from some range."""
    lines = line_image(
        mesh, aspect=aspect, depression=DEPRESSION, spacing=FINE_SPACING, slant_range=view_range
    )
    return range_extent(
        lines, slant_range=slant_range, ifov=15.0 / slant_range, bin_width=bin_width
    )


def _far_field_extent(ship: str, aspect: float) -> RangeExtent:
    """Return the extent by fine lines of the far field, with the wavefront added afterwards."""
    return _fine_extent(ncti.ships.load(ship), aspect, view_range=None)


def _fine_bins(ship: str, aspect: float) -> RangeExtent:
    """Return the truth in fine bins."""
    return _fine_extent(ncti.ships.load(ship), aspect, bin_width=1 / FINER_BINS)


def _sweep_extent(ship: str, aspect: float, *, engine: str) -> RangeExtent:
    """Return the extent as a sweep computes it by default with an engine."""
    mesh = ncti.ships.load(ship)
    view = image.function(
        mesh,
        drawn_aspect=aspect,
        depression=DEPRESSION,
        drawn_range=drawn_range(reach_of(mesh.vertices), SLANT_RANGE),
        sampling=Sampling(engine, Render.pixel.default, Render.samples.default, ROLL),
        fineness=(),
    )
    return range_extent(view, slant_range=SLANT_RANGE, ifov=15.0 / SLANT_RANGE)


def _single_precision_extent(ship: str, aspect: float) -> RangeExtent:
    """Return the extent by fine lines of the mesh rounded to float32, itself rounded to float32."""
    mesh = ncti.ships.load(ship)
    vertices = np.asarray(mesh.vertices).astype(np.float32)
    extent = _fine_extent(trimesh.Trimesh(vertices, mesh.faces, process=False), aspect)
    return replace(extent, fraction=extent.fraction.astype(np.float32).astype(np.float64))


def _plane_wave_extent(ship: str, aspect: float) -> RangeExtent:
    """Return the extent by fine lines of plane waves: as from a sensor at infinite distance."""
    return _fine_extent(ncti.ships.load(ship), aspect, view_range=None, slant_range=1e12)


def _pulse(extent: RangeExtent) -> Floats:
    """Return the power (bin,) of the whole ship after the pulse, in bins of 1 m.

    From finer bins, it takes those with the centres of bins of 1 m.
    """
    kernel = target_kernel(Pulse(SIGNAL["pulse_width"], extent.bin_width), extent.down_range.size)
    power: Floats = kernel**2 @ extent.density.sum(axis=0)
    return power if extent.bin_width == 1.0 else power[FINER_BINS // 2 :: FINER_BINS]


def _metre_moments(extent: RangeExtent, mean: Floats, band: Floats) -> tuple[Floats, Floats]:
    """Return moments of a frame in bins of 1 m, from finer bins those with the same centres."""
    if extent.bin_width == 1.0:
        return mean, band
    centres = slice(FINER_BINS // 2, None, FINER_BINS)
    return mean[centres], band[::FINER_BINS, centres]


def _errors(estimated: Sequence[Floats], exact: Sequence[Floats]) -> Sample:
    """Return the sum of absolute differences over the sum, view by view [%]."""
    return Sample.of(
        float(100 * np.abs(p - q).sum() / q.sum()) for p, q in zip(estimated, exact, strict=True)
    )


def _reference_error(views: Views, sampler: Callable[[str, float], RangeExtent]) -> Sample:
    """Return the error of extents against the sampling-free reference."""
    edges = np.arange(-125.0, 126.0)
    estimated, exact = [], []
    power = target_kernel(Pulse(SIGNAL["pulse_width"], 1.0), 250) ** 2
    for ship, aspect in views.ship_aspects(views.references):
        mesh, view = ncti.ships.load(ship), {"depression": DEPRESSION, "slant_range": SLANT_RANGE}
        area = reference_range_extent(mesh, aspect=aspect, bin_edges=edges, **view).area[0]
        exact.append(power @ area / 15.0**2)
        estimated.append(power @ sampler(ship, aspect).fraction.sum(axis=0))
    return _errors(estimated, exact)


def measure(views: Views | None = None) -> Report:
    """Return profile error and change of percent correct, by source of error.

    Parameters
    ----------
    views : Views, optional
        Views; the article's four ships by default.

    Returns
    -------
    Report
        One row for each source of error.
    """
    with threadpool_limits(1):
        return _measure(views or Views())


def _measure(views: Views) -> Report:
    best = views.percent_right(true_extent, views.averages)
    rows = _rows(views, best)
    percent = ", ".join(
        f"{group}°: {mean:.1f}" for group, mean in zip(ASPECT_BINS, best.mean(axis=0), strict=False)
    )
    return Report(
        f"Error budget: {', '.join(views.ships)}; 100 km, 30 ns, {FRAMES} frames",
        (
            Column("source", "source"),
            Column("setting", "default"),
            Column("error", "profile error [%]", ".3g"),
            *(Column(group, f"{group}° [points]") for group in ASPECT_BINS),
            Column("how", "measured"),
        ),
        rows,
        [
            "Profile error: sum of absolute differences over the sum of the exact profile, of all "
            "the ship in power after the pulse, in bins of 1 m; median (lowest–highest) of "
            f"{len(views.ship_aspects(views.references))} views against the reference, "
            f"{len(views.ship_aspects(views.aspects))} otherwise.",
            "Points: change of percent correct of the likelihood classifier with unknown gain and "
            "floor, with templates of that kind, and averages drawn from the truth, which "
            f"are the same in all rows; mean ± two standard errors of {views.replicates} draws. "
            f"With templates of the truth it identifies {percent} % correctly.",
        ],
    )


def _rows(views: Views, best: Floats) -> list[dict[str, Any]]:
    """Return a row for each approximation, beside percent correct with templates of the truth."""
    drawn = f"{Render.pixel.default:g} m, {Render.samples.default:g} samples"
    sampled = [partial(_sweep_extent, engine=engine) for engine in (choose_engine("auto"), "lines")]

    def profiles(sampler: ExtentOf) -> list[Floats]:
        return [_pulse(views.extent(sampler, *view)) for view in views.ship_aspects(views.aspects)]

    def error_of(sampler: ExtentOf) -> Sample:
        return _errors(profiles(sampler), profiles(true_extent))

    def templates(sampler: ExtentOf) -> Floats:
        return views.percent_right(sampler, views.averages) - best

    return [
        *(
            _source_row(
                name,
                f"{sampler.keywords['engine']}, {drawn}",
                _reference_error(views, sampler),
                templates(sampler),
                "against the sampling-free reference",
            )
            for name, sampler in zip(("pixel", "line"), sampled, strict=True)
        ),
        _source_row(
            "bin",
            "1 m",
            _errors(profiles(true_extent), profiles(_fine_bins)),
            templates(_fine_bins),
            f"against bins of 1/{FINER_BINS} m at the same ranges; names: templates of those",
        ),
        _source_row(
            "far field",
            "only within a tenth of a tolerance",
            error_of(_far_field_extent),
            templates(_far_field_extent),
            "far-field view, s²/2R added, against the view from 100 km, lines of 1/16 m; at most "
            f"{_share_of_bound(views):.2f} of its bound, which is part of `profile_error`",
        ),
        _source_row(
            "far field, plane waves",
            "never",
            error_of(_plane_wave_extent),
            templates(_plane_wave_extent),
            "the same without s²/2R: effect of that correction",
        ),
        _source_row(
            "float",
            "float32 mesh, extent, averages",
            error_of(_single_precision_extent),
            views.percent_right(
                _single_precision_extent, views.averages.astype(np.float32).astype(float)
            )
            - best,
            "against float64, lines of 1/16 m",
        ),
        _noise_row(views, best),
        _spacing_row(views),
    ]


def _spacing_row(views: Views) -> dict[str, Any]:
    """Return the row of the template spacing."""
    between = partial(views.percent_right, true_extent, views.averages_between, between=True)
    return _source_row(
        "template spacing",
        f"{STEP:g}°",
        _neighbour_distance(views),
        between() - between(aspects=tuple(sorted((*views.aspects, *views.between)))),
        f"{STEP / 2:g}° off, nearest template against the view itself; names: of views "
        "between templates, against these learned, too",
    )


def _source_row(
    name: str, setting: str, error: Sample, change: Floats, method: str
) -> dict[str, Any]:
    """Return a row: an error, and the change of percent correct by draw and group."""
    spread = change.std(axis=0, ddof=1) / math.sqrt(len(change))
    points = {
        group: f"{mean:+.1f} ± {2 * sigma:.1f}"
        for group, mean, sigma in zip(ASPECT_BINS, change.mean(axis=0), spread, strict=False)
    }
    return {"source": name, "setting": setting, "error": error, "how": method} | points


def _share_of_bound(views: Views) -> float:
    """Return the largest error of drawing the far field, over its bound, of all views."""
    shares = []
    for view in views.ship_aspects(views.aspects):
        exact, far = (
            _pulse(views.extent(true_extent, *view)),
            views.extent(_far_field_extent, *view),
        )
        error = np.abs(_pulse(far) - exact).sum() / exact.sum()
        shares.append(float(error / far.far_field_error))
    return max(shares)


def _noise_row(views: Views, best: Floats) -> dict[str, Any]:
    """Return the row of the noise of one draw."""
    errors = []
    for view in views.ship_aspects(views.aspects):
        extent = views.extent(true_extent, *view)
        mean, band = banded_frame_moments(extent, frame_count=FRAMES, **SIGNAL)
        above = mean - mean[0]
        errors.append(100 * math.sqrt(2 / math.pi) * np.sqrt(band[0]).sum() / above.sum())
    deviation = best.std(axis=0, ddof=1)
    return {
        "source": "draws",
        "setting": f"{FRAMES} frames, one replicate",
        "error": Sample.of(errors),
        "how": "noise of an average, of amplitudes above the floor, in closed form (mean "
        "deviation); names: standard deviation of one draw",
    } | {group: f"± {sigma:.1f}" for group, sigma in zip(ASPECT_BINS, deviation, strict=False)}


def _neighbour_distance(views: Views) -> Sample:
    """Return the distance of profiles between two templates to the nearer template."""
    nearest, exact = [], []
    for ship, aspect in views.ship_aspects(views.between):
        between = _pulse(views.extent(true_extent, ship, aspect))
        near = min(
            (_pulse(views.extent(true_extent, ship, learned)) for learned in views.aspects),
            key=lambda profile: float(np.abs(profile - between).sum()),
        )
        nearest.append(near)
        exact.append(between)
    return _errors(nearest, exact)
