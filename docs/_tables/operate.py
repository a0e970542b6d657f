"""Tables of docs/operate.md: sufficient sensors, and the cost of shortcuts."""

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
from docs._tables.proof import LoneSetting, prove_sweep
from docs._tables.sensitivity import grid_interpolant, interpolation_errors, sobol_indices
from docs._tables.sweeping import choices_of, sweep_groups
from ncti.classify.likelihood import GaussianTemplates
from ncti.ladar import banded_frame_moments, noise_floor, power_ratio, range_extent, sample_frames
from ncti.render import LineImage
from studies.operate.fleets import fleet_order
from studies.operate.identify import LEFT_OUT, planned_views
from studies.operate.matching import ship_evidence
from studies.operate.profiles import ProfileMatch, Radar, signatures
from studies.operate.stages import Operate
from studies.operate.survey import DRAWN_FOR, ViewExtents, draw_views, seen_views
from studies.operate.tables import LEVEL, frames_needed
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import Grid

Floats = NDArray[np.float64]
SHIPS = ("duncan", "horne", "spruance", "texas")
AXES = ("range", "ifov", "cnr", "pulse_width", "frame_count", "fleet")
SENSOR_AXES = (Grid.range, Ladar.ifov, Ladar.cnr, Grid.pulse_width, Grid.frame_count)
EXPERIMENT = ("+experiment=operate",)
LEVELS = (0, 50, 80, 95, 100)  # percent identified by the better of two sensors
TAIL = 0.025
OPEN_SWEEP = [
    *(*EXPERIMENT, "grid.range=[50,100]", "ladar.ifov=150", "ladar.cnr=32"),
    *("grid.pulse_width=[10,30]", "operate.fleet=[4,6,10,20,60]"),
    "ladar.target_free_ifovs=[0,1000,4000,16000]",
    *("classifier.gain_sigma=[0,1]", "classifier.floor_sigma=[0,1]"),
]
# Settings between those of the sweep.
BETWEEN_SWEEP = [
    *(*EXPERIMENT, "grid.range=[60,85]", "ladar.ifov=[105]", "ladar.cnr=[26,30]"),
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
    """Views of ships: pieces of lines, places on the IFOVs, and the number learned of each ship."""

    lines: list[list[LineImage]]
    places: list[Floats]
    learned: int


def plan_views(tests: int, spacing: float = 0.75, ships: Sequence[str] = SHIPS) -> Views:
    """Return templates, and as many random views in all."""
    aspects = np.arange(0, 90 + spacing / 2, spacing)
    lines, places = [], []
    for number, ship in enumerate(ships):
        plan = planned_views(aspects.tolist(), tests, np.random.default_rng([7, number]))
        lines.append(draw_views(ncti.ships.load(ship), plan["aspects"][:-LEFT_OUT], spacing=0.5))
        places.append(plan["places"][:-LEFT_OUT])
    return Views(lines, places, len(aspects))


def compare_likelihoods(
    setting: Setting, views: Views, draws: int, free: int = 4000
) -> dict[str, NDArray[np.bool_]]:
    """Return masks of views that are named right, ship by ship, in three ways.

    `exact`, (view,): the likelihood with each template's exact covariance, of sampled frames.
    `one`, (draw, view): the likelihood with one covariance, of the same averages and further ones.
    `drawn`, (draw, view): the same with Gaussian noise.
    """
    side, width = 0.15 * setting.slant_range, setting.pulse_width * 1e-9
    pulse: dict[str, Any] = {"pulse_width": width, "cnr": setting.ratio}
    radar = Radar(**pulse, bin_width=1.0)
    sigma = 0.0 if setting.known else 1.0
    signature_sets, extents, sampled = [], [], []
    for number, (lines, places) in enumerate(zip(views.lines, views.places, strict=True)):
        extents_seen = seen_views(lines, places, footprint=side)
        signature_sets.append(_signatures(extents_seen, setting, views.learned))
        beam = {"slant_range": DRAWN_FOR, "ifov": side / DRAWN_FOR}
        ship_extents = [
            range_extent(line, shift=(place[0], place[1]), **beam)  # type: ignore[arg-type]
            for line, place in zip(lines, places.tolist(), strict=True)
        ]
        extents.append(ship_extents[: views.learned])
        for k, extent in enumerate(ship_extents[views.learned :]):
            rng = np.random.default_rng([setting.frames, number, k])
            frames = sample_frames(
                extent, frame_count=draws * setting.frames, rng=rng, target_free_ifovs=free, **pulse
            )
            of_draws = frames.reshape(draws, setting.frames, -1).mean(axis=1)
            sampled.append(of_draws - (free + len(extent.cell)) * noise_floor())
    averages = np.swapaxes(sampled, 0, 1)
    ships, count = len(signature_sets), len(sampled) // len(signature_sets)
    true = np.repeat(np.arange(ships), count)
    moments = [
        banded_frame_moments(extent, target_free_ifovs=free, **pulse)
        for ship_extents in extents
        for extent in ship_extents
    ]
    floors = [
        (free + len(extent.cell)) * noise_floor()
        for ship_extents in extents
        for extent in ship_extents
    ]
    means = np.array([mean for mean, _ in moments]) - np.array(floors)[:, None]
    labels = np.repeat(np.arange(ships), views.learned)
    exact = GaussianTemplates(gain_sigma=sigma, floor_sigma=sigma)
    exact.fit(means, np.array([band for _, band in moments]), labels, floor=0.0)
    answers = {"exact": exact.predict(averages[0], setting.frames)}
    learned = np.array([arrays["excess"][0, 0, : views.learned] for arrays in signature_sets])
    tests = np.concatenate([arrays["excess"][0, 0, views.learned :] for arrays in signature_sets])
    power = np.concatenate([arrays["power"][0, 0, 1:] for arrays in signature_sets])
    mean = np.mean([arrays["power"][0, 0, 0] for arrays in signature_sets], axis=0)
    ifovs = free + np.concatenate([arrays["ifovs"][0, 0] for arrays in signature_sets])
    normals = np.random.default_rng(setting.frames).standard_normal((draws, len(tests), 2, 250))

    def identify_views(profiles: Floats, noise: Floats) -> NDArray[np.intp]:
        match = ProfileMatch(learned, profiles, power, mean, ifovs, noise, radar, floor_sigma=sigma)
        evidence = match.evidence(setting.frames, gain_sigma=sigma)
        return ship_evidence(evidence, ships).argmax(axis=1)

    answers["one"] = np.array([identify_views(profiles, 0 * normals[0]) for profiles in averages])
    answers["drawn"] = np.array([identify_views(tests, noise) for noise in normals])
    return {name: ships_named == true for name, ships_named in answers.items()}


def _signatures(seen: ViewExtents, setting: Setting, learned: int) -> dict[str, NDArray[Any]]:
    options: dict[str, Any] = {"bin_width": 1.0, "bins": 250, "learned": learned}
    return signatures(
        seen, pulse_width=[setting.pulse_width * 1e-9], cnr=[setting.ratio], **options
    )


def difference(right: NDArray[np.bool_], other: NDArray[np.bool_]) -> str:
    """Return the difference of two percentages of the same views, with its 95 % interval.

    Draws of one view are correlated and views are independent, so views give the scatter.
    """
    change = np.atleast_2d(right).mean(axis=0) - np.atleast_2d(other).mean(axis=0)
    return f"{100 * change.mean():+.1f} ± {196 * change.std() / np.sqrt(change.size):.1f}"


def likelihood_report(tests: int = 400, draws: int = 12) -> Report:
    """Return the likelihood of one covariance beside the exact one."""
    views, rows = plan_views(tests), []
    for setting in SETTINGS:
        right = compare_likelihoods(setting, views, draws)
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


def open_parameter_report(shares: xr.Dataset) -> Report:
    """Return percentages and required frames by the parameters that the article leaves open."""
    frame_counts, rows = frames_needed(shares).isel(resample=0), []
    for free in shares.target_free_ifovs.values:
        for gain in shares.gain_sigma.values:
            for floor in shares.floor_sigma.values:
                setting = {"target_free_ifovs": free, "gain_sigma": gain, "floor_sigma": floor}
                row: dict[str, Any] = {"free": int(free)}
                row |= {"gain": "unknown" if gain else "known"}
                row |= {"floor": "unknown" if floor else "known"}
                for km in (50, 100):
                    for channel in ("profile", "both"):
                        cell = setting | {"range": km, "channel": channel, "pulse_width": 30}
                        share = 100 * shares.share.sel(cell).sel(fleet=6, frame_count=16)
                        frames = frame_counts.sel(cell).sel(fleet=4).item()
                        row[f"{channel}_{km}"] = float(share.item())
                        row[f"frames_{channel}_{km}"] = "–" if frames == np.inf else f"{frames:.0f}"
                rows.append(row)
    columns = [Column("free", "target-free IFOVs", ",d"), Column("gain", "gain")]
    columns.append(Column("floor", "floor"))
    for km in (50, 100):
        for channel in ("profile", "both"):
            look = f"{km} km, {channel}"
            columns.append(Column(f"{channel}_{km}", f"{look}: 6 ships, 16 frames [%]", ".0f"))
            columns.append(Column(f"frames_{channel}_{km}", f"{look}: frames for 95 % of 4 ships"))
    notes = ["32 dB, 30 ns, 150 urad."]
    return Report("What the article leaves open", tuple(columns), rows, notes)


def places_of(shares: xr.Dataset) -> list[Floats]:
    """Return the values of a sweep's axes for the interpolant, with the CNR as a ratio."""
    places = {name: shares[name].values.astype(float) for name in AXES}
    return [10 ** (values / 10) if name == "cnr" else values for name, values in places.items()]


def sobol(shares: xr.Dataset, samples: int = 1024, resamples: int = 20) -> Report:
    """Return Sobol indices with the intervals of sampling and of views together."""
    places, rows = places_of(shares), []
    bounds = {
        name: tuple(np.log(values[[0, -1]])) for name, values in zip(AXES, places, strict=True)
    }
    for channel in shares.channel.values:
        channel_shares = shares.sel(channel=channel).transpose(*AXES, "resample")
        indices = sobol_indices(
            grid_interpolant(places, channel_shares.share), bounds, samples=samples
        )
        resampled_indices = [
            sobol_indices(
                grid_interpolant(places, channel_shares.resampled[..., k]),
                bounds,
                samples=samples // 4,
            )
            for k in range(min(resamples, channel_shares.sizes["resample"]))
        ]
        for kind in ("first", "total"):
            noise = np.std([redrawn[kind] for redrawn in resampled_indices], axis=0)
            ends = np.hypot(indices[f"{kind}_interval"], 1.96 * noise)
            cells = [f"{a:.2f} ± {b:.2f}" for a, b in zip(indices[kind], ends, strict=True)]
            rows.append({"what": f"{channel}, {kind}", **dict(zip(AXES, cells, strict=True))})
    columns = (Column("what", "percent identified by"), *(Column(name, name) for name in AXES))
    note = (
        "SALib, Saltelli's design on the interpolant of the grid, settings uniform in their "
        "logarithms. Half widths of 95 % intervals, of the sampling and of the views together."
    )
    return Report("Sobol indices", columns, rows, [note])


def interpolant(shares: xr.Dataset, between: xr.Dataset) -> Report:
    """Return the error of the interpolant at left-out values and at settings between."""
    places, rows = places_of(shares), []
    points = np.stack(
        [a.ravel() for a in np.meshgrid(*map(np.log, places_of(between)), indexing="ij")], axis=1
    )
    for channel in shares.channel.values:
        channel_shares = shares.share.sel(channel=channel).transpose(*AXES)
        errors = 100 * interpolation_errors(places, channel_shares)
        true = between.share.sel(channel=channel).transpose(*AXES).values.ravel()
        off = 100 * (grid_interpolant(places, channel_shares)(points) - true)
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
    """Compare both sensors with the better one, by the percentage of the better."""
    single = shares.share.sel(channel=["profile", "silhouette"])
    best = single.idxmax("channel")
    gain = 100 * (shares.share.sel(channel="both") - single.max("channel"))
    resampled_gain = 100 * (
        shares.resampled.sel(channel="both") - shares.resampled.sel(channel=best)
    )
    surely = resampled_gain.quantile(1 - TAIL, "resample") < 0
    level, rows = 100 * single.max("channel"), []
    for low, high in itertools.pairwise(LEVELS):
        which = (level > low) & (level <= high)
        if which.any():
            rows.append(_fusion_row(f"{low} to {high}", gain, surely, which))
    rows.append(_fusion_row("all", gain, surely, level >= 0))
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


def _fusion_row(
    name: str, gain: xr.DataArray, surely: xr.DataArray, which: xr.DataArray
) -> dict[str, Any]:
    """Return a row of `fusion` for some settings."""
    gains = gain.transpose(*which.dims).values[which.values]
    return {
        "level": name,
        "settings": gains.size,
        "mean": gains.mean(),
        "loss": -np.minimum(gains, 0).mean(),
        "least": np.quantile(gains, 0.01),
        "surely": 100 * surely.transpose(*which.dims).values[which.values].mean(),
    }


def lone_settings(overrides: Sequence[str] = EXPERIMENT) -> Iterator[LoneSetting]:
    """Yield random settings of a sweep, one for each number of ships, with only these ships.

    Ships share a covariance, so figures equal the sweep's only if all its ships take part.
    """
    choices = choices_of(overrides)
    ships = [str(ship) for ship in choices[Grid.ship]]
    order = fleet_order(ships)
    rng = np.random.default_rng(0)
    for fleet in choices[Operate.fleet]:
        point = {setting.name: rng.choice(choices[setting]).item() for setting in SENSOR_AXES} | {
            "fleet": fleet
        }

        def is_same(whole: xr.Dataset, single: xr.Dataset, point: dict[str, Any] = point) -> bool:
            return bool((single.share.squeeze() == whole.share.sel(point)).all())

        ship_list = ",".join(ships[k] for k in order[:fleet])
        values = [
            f"{setting.key}={point[setting.name]}" for setting in (*SENSOR_AXES, Operate.fleet)
        ]
        arguments = (*overrides, f"grid.ship=[{ship_list}]", *values)
        yield LoneSetting(arguments, is_same if fleet == len(ships) else None)


def measure() -> dict[str, Report]:
    """Return all tables of the page."""
    choices = choices_of(EXPERIMENT)
    settings = math.prod(len(choices[setting]) for setting in (*SENSOR_AXES, Operate.fleet))
    (shares,), engine = prove_sweep(EXPERIMENT, ["operate"], settings, lone_settings())
    open_shares, between = (
        sweep_groups(arguments, ["operate"])["operate"] for arguments in (OPEN_SWEEP, BETWEEN_SWEEP)
    )
    between = between.expand_dims({name: [105.0] for name in ("ifov",) if name not in between.dims})
    reports = {
        "engine": engine,
        "matching": likelihood_report(),
        "open": open_parameter_report(open_shares),
    }
    reports["fusion"] = fusion(shares)
    return reports | {"interpolant": interpolant(shares, between), "sobol": sobol(shares)}
