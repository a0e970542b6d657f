"""What sensor suffices: the tables of docs/operate.md, and what its shortcuts cost."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import ncti.ships
from benchmarks.reports import Column, Report
from docs._tables.proof import Alone, proven
from docs._tables.sweeping import choices_of, swept
from ncti.classify.likelihood import GaussianTemplates
from ncti.ladar import banded_frame_moments, noise_floor, power_ratio, range_extent, sample_frames
from ncti.render import LineImage
from studies.operate import (
    ProfileMatch,
    Radar,
    Seen,
    draw_views,
    fleet_order,
    planned_views,
    seen_views,
    ship_evidence,
    signatures,
)
from studies.operate.identify import LEFT_OUT
from studies.operate.sensitivity import grid_interpolant, interpolation_errors, sobol_indices
from studies.operate.stages import Operate
from studies.operate.survey import DRAWN_FOR
from studies.operate.tables import LEVEL, frames_needed
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import Grid

Floats = NDArray[np.float64]
SHIPS = ("duncan", "horne", "spruance", "texas")
AXES = ("range", "ifov", "cnr", "pulse_width", "frame_count", "fleet")
OF_SENSORS = (Grid.range, Ladar.ifov, Ladar.cnr, Grid.pulse_width, Grid.frame_count)
WHOLE = ("+experiment=operate",)
LEVELS = (0, 50, 80, 95, 100)  # percent identified by the better of two sensors
TAIL = 0.025
OPEN = [
    *(*WHOLE, "grid.range=[50,100]", "ladar.ifov=150", "ladar.cnr=32"),
    *("grid.pulse_width=[10,30]", "operate.fleet=[4,6,10,20,60]"),
    "ladar.target_free_ifovs=[0,1000,4000,16000]",
    *("classifier.gain_sigma=[0,1]", "classifier.floor_sigma=[0,1]"),
]
# Settings between those of the sweep.
BETWEEN = [
    *(*WHOLE, "grid.range=[60,85]", "ladar.ifov=[105]", "ladar.cnr=[26,30]"),
    *("grid.pulse_width=[14,40]", "grid.frame_count=[6,23]", "operate.fleet=[4,10,30]"),
]


class Setting(NamedTuple):
    """A setting at which the match is compared with the exact likelihood."""

    slant_range: float  # [km]
    frames: int
    pulse_width: float = 30.0  # [ns]
    cnr: float = 32.0  # at 100 km [dB]
    known: bool = False  # gain and floor

    @property
    def ratio(self) -> float:
        """Carrier-to-noise ratio at the slant range, as a power ratio."""
        return power_ratio(self.cnr) * (100 / self.slant_range) ** 2


SETTINGS = (
    Setting(100, 16),
    Setting(100, 16, known=True),
    Setting(100, 4),
    Setting(100, 16, pulse_width=10),
    Setting(50, 16),
    Setting(25, 16),
    Setting(100, 16, cnr=26),
)


class Views(NamedTuple):
    """Views of ships: pieces of lines, places on the IFOVs, and how many are learned of each."""

    lines: list[list[LineImage]]
    places: list[Floats]
    learned: int


def planned(tests: int, spacing: float = 0.75, ships: Sequence[str] = SHIPS) -> Views:
    """Return templates, and as many random views in all."""
    aspects = np.arange(0, 90 + spacing / 2, spacing)
    lines, places = [], []
    for number, ship in enumerate(ships):
        plan = planned_views(aspects.tolist(), tests, np.random.default_rng([7, number]))
        lines.append(draw_views(ncti.ships.load(ship), plan["aspects"][:-LEFT_OUT], spacing=0.5))
        places.append(plan["places"][:-LEFT_OUT])
    return Views(lines, places, len(aspects))


def compared(
    setting: Setting, views: Views, draws: int, free: int = 4000
) -> dict[str, NDArray[np.bool_]]:
    """Return which views are named right, ship by ship: three ways.

    `exact`, (view,): the likelihood with each template's exact covariance, of sampled frames.
    `one`, (draw, view): that of one covariance, of the same averages and further ones.
    `drawn`, (draw, view): the same, of Gaussian noise.
    """
    side, width = 0.15 * setting.slant_range, setting.pulse_width * 1e-9
    pulse: dict[str, Any] = {"pulse_width": width, "cnr": setting.ratio}
    radar = Radar(**pulse, bin_width=1.0)
    sigma = 0.0 if setting.known else 1.0
    made, extents, sampled = [], [], []
    for number, (lines, places) in enumerate(zip(views.lines, views.places, strict=True)):
        seen = seen_views(lines, places, footprint=side)
        made.append(_signatures(seen, setting, views.learned))
        beam = {"slant_range": DRAWN_FOR, "ifov": side / DRAWN_FOR}
        own = [
            range_extent(line, shift=(at[0], at[1]), **beam)  # type: ignore[arg-type]
            for line, at in zip(lines, places.tolist(), strict=True)
        ]
        extents.append(own[: views.learned])
        for k, extent in enumerate(own[views.learned :]):
            rng = np.random.default_rng([setting.frames, number, k])
            frames = sample_frames(
                extent, frame_count=draws * setting.frames, rng=rng, target_free_ifovs=free, **pulse
            )
            of_draws = frames.reshape(draws, setting.frames, -1).mean(axis=1)
            sampled.append(of_draws - (free + len(extent.cell)) * noise_floor())
    averages = np.swapaxes(sampled, 0, 1)
    ships, each = len(made), len(sampled) // len(made)
    true = np.repeat(np.arange(ships), each)
    moments = [
        banded_frame_moments(extent, target_free_ifovs=free, **pulse)
        for own in extents
        for extent in own
    ]
    floors = [(free + len(extent.cell)) * noise_floor() for own in extents for extent in own]
    means = np.array([mean for mean, _ in moments]) - np.array(floors)[:, None]
    labels = np.repeat(np.arange(ships), views.learned)
    exact = GaussianTemplates(gain_sigma=sigma, floor_sigma=sigma)
    exact.fit(means, np.array([band for _, band in moments]), labels, floor=0.0)
    answers = {"exact": exact.predict(averages[0], setting.frames)}
    learned = np.array([one["excess"][0, 0, : views.learned] for one in made])
    tests = np.concatenate([one["excess"][0, 0, views.learned :] for one in made])
    power = np.concatenate([one["power"][0, 0, 1:] for one in made])
    mean = np.mean([one["power"][0, 0, 0] for one in made], axis=0)
    ifovs = free + np.concatenate([one["ifovs"][0, 0] for one in made])
    normals = np.random.default_rng(setting.frames).standard_normal((draws, len(tests), 2, 250))

    def named(profiles: Floats, noise: Floats) -> NDArray[np.intp]:
        match = ProfileMatch(learned, profiles, power, mean, ifovs, noise, radar, floor_sigma=sigma)
        evidence = match.evidence(setting.frames, gain_sigma=sigma)
        return ship_evidence(evidence, ships).argmax(axis=1)

    answers["one"] = np.array([named(profiles, 0 * normals[0]) for profiles in averages])
    answers["drawn"] = np.array([named(tests, noise) for noise in normals])
    return {name: ships_named == true for name, ships_named in answers.items()}


def _signatures(seen: Seen, setting: Setting, learned: int) -> dict[str, NDArray[Any]]:
    how: dict[str, Any] = {"bin_width": 1.0, "bins": 250, "learned": learned}
    return signatures(seen, pulse_width=[setting.pulse_width * 1e-9], cnr=[setting.ratio], **how)


def difference(right: NDArray[np.bool_], other: NDArray[np.bool_]) -> str:
    """Return the difference of two percentages of the same views, with its 95 % interval.

    Answers to a view are correlated, and those to others are not: the views scatter.
    """
    apart = np.atleast_2d(right).mean(axis=0) - np.atleast_2d(other).mean(axis=0)
    return f"{100 * apart.mean():+.1f} ± {196 * apart.std() / np.sqrt(apart.size):.1f}"


def matching(tests: int = 400, draws: int = 12) -> Report:
    """Return the likelihood of one covariance beside the exact one."""
    views, rows = planned(tests), []
    for setting in SETTINGS:
        right = compared(setting, views, draws)
        rows.append(
            {
                **setting._asdict(),
                "known": "known" if setting.known else "unknown",
                **{name: 100 * answers.mean() for name, answers in right.items()},
                "apart": difference(right["one"][0], right["exact"]),
                "noise": difference(right["drawn"], right["one"]),
            }
        )
    columns = (
        Column("slant_range", "range [km]", "g"),
        Column("cnr", "CNR at 100 km [dB]", "g"),
        Column("pulse_width", "pulse [ns]", "g"),
        Column("frames", "frames", "d"),
        Column("known", "gain and floor"),
        Column("exact", "own covariances, sampled frames [%]", ".1f"),
        Column("one", "one covariance, same averages [%]", ".1f"),
        Column("apart", "one less own covariances"),
        Column("drawn", "one covariance, Gaussian noise [%]", ".1f"),
        Column("noise", "Gaussian less sampled"),
    )
    note = (
        f"{tests} views of four ships, 150 urad, of which all but the exact likelihood, and its "
        f"difference, have {draws} draws. Differences are paired, view by view."
    )
    return Report("One covariance beside each template's own", columns, rows, [note])


def left_open(shares: xr.Dataset) -> Report:
    """Return percentages and frames needed by what the article leaves open."""
    needed, rows = frames_needed(shares).isel(resample=0), []
    for free in shares.target_free_ifovs.values:
        for gain in shares.gain_sigma.values:
            for floor in shares.floor_sigma.values:
                at = {"target_free_ifovs": free, "gain_sigma": gain, "floor_sigma": floor}
                row: dict[str, Any] = {"free": int(free)}
                row |= {"gain": "unknown" if gain else "known"}
                row |= {"floor": "unknown" if floor else "known"}
                for km in (50, 100):
                    for channel in ("profile", "both"):
                        where = at | {"range": km, "channel": channel, "pulse_width": 30}
                        share = 100 * shares.share.sel(where).sel(fleet=6, frame_count=16)
                        frames = needed.sel(where).sel(fleet=4).item()
                        row[f"{channel}_{km}"] = float(share.item())
                        row[f"frames_{channel}_{km}"] = "–" if frames == np.inf else f"{frames:.0f}"
                rows.append(row)
    columns = [Column("free", "target-free IFOVs", ",d"), Column("gain", "gain")]
    columns.append(Column("floor", "floor"))
    for km in (50, 100):
        for channel in ("profile", "both"):
            seen = f"{km} km, {channel}"
            columns.append(Column(f"{channel}_{km}", f"{seen}: 6 ships, 16 frames [%]", ".0f"))
            columns.append(Column(f"frames_{channel}_{km}", f"{seen}: frames for 95 % of 4 ships"))
    notes = ["32 dB, 30 ns, 150 urad."]
    return Report("What the article leaves open", tuple(columns), rows, notes)


def places_of(shares: xr.Dataset) -> list[Floats]:
    """Return the places of a sweep's axes as the interpolant takes them: the CNR as a ratio."""
    places = {name: shares[name].values.astype(float) for name in AXES}
    return [10 ** (at / 10) if name == "cnr" else at for name, at in places.items()]


def sobol(shares: xr.Dataset, samples: int = 1024, resamples: int = 20) -> Report:
    """Return Sobol indices with the intervals of sampling and of views together."""
    places, rows = places_of(shares), []
    bounds = {name: tuple(np.log(at[[0, -1]])) for name, at in zip(AXES, places, strict=True)}
    for channel in shares.channel.values:
        here = shares.sel(channel=channel).transpose(*AXES, "resample")
        whole = sobol_indices(grid_interpolant(places, here.share), bounds, samples=samples)
        again = [
            sobol_indices(
                grid_interpolant(places, here.resampled[..., k]), bounds, samples=samples // 4
            )
            for k in range(min(resamples, here.sizes["resample"]))
        ]
        for kind in ("first", "total"):
            noise = np.std([getattr(one, kind) for one in again], axis=0)
            ends = np.hypot(getattr(whole, f"{kind}_interval"), 1.96 * noise)
            cells = [f"{a:.2f} ± {b:.2f}" for a, b in zip(getattr(whole, kind), ends, strict=True)]
            rows.append({"what": f"{channel}, {kind}", **dict(zip(AXES, cells, strict=True))})
    columns = (Column("what", "percent identified by"), *(Column(name, name) for name in AXES))
    note = (
        "SALib, Saltelli's design on the interpolant of the grid, settings uniform in their "
        "logarithms. Half widths of 95 % intervals, of the sampling and of the views together."
    )
    return Report("Sobol indices", columns, rows, [note])


def interpolant(shares: xr.Dataset, between: xr.Dataset) -> Report:
    """Return the error of the interpolant: by places left out, and at settings between."""
    places, rows = places_of(shares), []
    points = np.stack(
        [a.ravel() for a in np.meshgrid(*map(np.log, places_of(between)), indexing="ij")], axis=1
    )
    for channel in shares.channel.values:
        here = shares.share.sel(channel=channel).transpose(*AXES)
        errors = 100 * interpolation_errors(places, here)
        true = between.share.sel(channel=channel).transpose(*AXES).values.ravel()
        off = 100 * (grid_interpolant(places, here)(points) - true)
        noise = 100 * np.sqrt(np.mean(true * (1 - true)) / 192)
        row = dict(zip(AXES, errors, strict=True))
        rows.append(
            {"channel": str(channel), **row, "rms": np.sqrt(np.mean(off**2)), "bias": off.mean()}
            | {"noise": noise}
        )
    columns = (
        Column("channel", "channel"),
        *(Column(name, f"{name} left out", ".1f") for name in AXES),
        Column("rms", "between, rms", ".1f"),
        Column("bias", "mean", ".1f"),
        Column("noise", "of which views", ".1f"),
    )
    note = (
        "Percentage points. Left out: every second place of an axis, interpolated from its "
        f"neighbours. Between: {len(points)} settings off the grid on all axes, computed."
    )
    return Report("Error of the interpolant", columns, rows, [note])


def fusion(shares: xr.Dataset) -> Report:
    """Return how both sensors compare with the better of them, by percentage of the better."""
    alone = shares.share.sel(channel=["profile", "silhouette"])
    best = alone.idxmax("channel")
    apart = 100 * (shares.share.sel(channel="both") - alone.max("channel"))
    again = 100 * (shares.resampled.sel(channel="both") - shares.resampled.sel(channel=best))
    surely = again.quantile(1 - TAIL, "resample") < 0
    level, rows = 100 * alone.max("channel"), []
    for low, high in itertools.pairwise(LEVELS):
        which = (level > low) & (level <= high)
        if which.any():
            rows.append(_apart(f"{low} to {high}", apart, surely, which))
    rows.append(_apart("all", apart, surely, level >= 0))
    frames = frames_needed(shares)
    fewest = frames.isel(resample=0).sel(channel=["profile", "silhouette"]).idxmin("channel")
    more = frames.sel(channel="both") > frames.sel(channel=fewest.fillna("profile"))
    contours = 100 * (more.isel(resample=slice(1, None)).mean("resample") >= 1 - TAIL).mean().item()
    columns = (
        Column("level", "the better alone [%]"),
        Column("settings", "settings", ",d"),
        Column("mean", "both less the better, mean", "+.2f"),
        Column("loss", "mean loss", ".2f"),
        Column("least", "lowest 1 %", "+.1f"),
        Column("surely", "below by more than its interval [%]", ".2f"),
    )
    note = (
        "Percentage points. The mean loss counts settings in which both are not below as 0. "
        "Intervals are of 95 % over resampled views, of both less the better in the same views. "
        f"Of the contours at {100 * LEVEL:.0f} %, {contours:.2f} % lie at more frames with both by "
        "more than their intervals."
    )
    return Report("Both sensors and the better of them", columns, rows, [note])


def _apart(
    name: str, apart: xr.DataArray, surely: xr.DataArray, which: xr.DataArray
) -> dict[str, Any]:
    """Return a row of `fusion` for some settings."""
    here = apart.transpose(*which.dims).values[which.values]
    return {
        "level": name,
        "settings": here.size,
        "mean": here.mean(),
        "loss": -np.minimum(here, 0).mean(),
        "least": np.quantile(here, 0.01),
        "surely": 100 * surely.transpose(*which.dims).values[which.values].mean(),
    }


def settings_alone(overrides: Sequence[str] = WHOLE) -> Iterator[Alone]:
    """Yield settings of a sweep at random, one of each number of ships, with these ships alone.

    Ships share a covariance: where they are all of the sweep's, figures are the same.
    """
    choices = choices_of(overrides)
    ships = [str(ship) for ship in choices[Grid.ship]]
    order = fleet_order(ships)
    rng = np.random.default_rng(0)
    for fleet in choices[Operate.fleet]:
        at = {one.name: rng.choice(choices[one]).item() for one in OF_SENSORS} | {"fleet": fleet}

        def same(whole: xr.Dataset, alone: xr.Dataset, at: dict[str, Any] = at) -> bool:
            return bool((alone.share.squeeze() == whole.share.sel(at)).all())

        first = ",".join(ships[k] for k in order[:fleet])
        values = [f"{one.key}={at[one.name]}" for one in (*OF_SENSORS, Operate.fleet)]
        asked = (*overrides, f"grid.ship=[{first}]", *values)
        yield Alone(asked, same if fleet == len(ships) else None)


def measure() -> dict[str, Report]:
    """Return all tables of the page."""
    choices = choices_of(WHOLE)
    settings = math.prod(len(choices[one]) for one in (*OF_SENSORS, Operate.fleet))
    (shares,), engine = proven(WHOLE, ["operate"], settings, settings_alone())
    open_shares, between = (swept(asked, ["operate"])["operate"] for asked in (OPEN, BETWEEN))
    between = between.expand_dims({name: [105.0] for name in ("ifov",) if name not in between.dims})
    reports = {"engine": engine, "matching": matching(), "open": left_open(open_shares)}
    reports["fusion"] = fusion(shares)
    return reports | {"interpolant": interpolant(shares, between), "sobol": sobol(shares)}
