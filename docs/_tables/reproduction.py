"""The article's other figures beside ours: effects of assumptions, and results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import ncti.ships
from benchmarks.reports import Column, Report
from docs._tables.fits import (
    INFRARED,
    Floats,
    format_errors,
    mean_and_error,
    overall_percent,
    percent,
)
from docs._tables.sweeping import sweep_groups
from ncti.article import article_figures
from ncti.features import profile_vector
from ncti.irar import profile_correlation

CLASSIFIERS = ("acn", "mnn", "correlation", "likelihood")
FLIGHTS = (
    *("sensor=irar", "grid.ship=[connole,roberts,duncan]", "grid.replicate=4"),
    "grid.aspect=175",
)
MAX_SHIFT = 10  # bins by which profiles of two ships may be shifted against each other
ASSUMED_PARAMETERS = ("stern_to_hangar", "transom_ratio", "mast_position", "forward_position")
TILTS = ("mast_tilt", "waterline_tilt", "intensity_mast_tilt", "intensity_waterline_tilt")


def spread(overrides: Sequence[str] = INFRARED, spreads: Sequence[float] = (0.1, 0.0)) -> Report:
    """Return the effect of a spread of the temperatures of ship and sea on silhouettes."""
    listed = ",".join(map(str, spreads))
    zipped = [
        *(f"infrared.{target}_spread=[{listed}]" for target in ("target", "sea")),
        "grid.zip=[[target_spread,sea_spread]]",
    ]
    arguments = [*overrides, "grid.range=[25,50,100]", *zipped]
    together = ["+experiment=fusion", "grid.frame_count=16", "infrared.frame_count=16", *zipped]
    groups = ("classification/acn_infrared", "tables/detection")
    answers, detected = sweep_groups(arguments, groups).values()
    (fused,) = sweep_groups(together, ["classification/fusion"]).values()
    rows: list[dict[str, Any]] = []

    def add(what: str, correct: xr.DataArray) -> dict[str, Any]:
        row = {"what": what}
        for value in spreads:
            chosen = correct.isel(
                {axis_of(correct): np.flatnonzero(correct.target_spread == value)[0]}
            )
            row[f"bins_{value:g}"] = format_errors(*mean_and_error(percent(chosen)))
            row[f"all_{value:g}"] = format_errors(*mean_and_error(overall_percent(chosen)))
        rows.append(row)
        return row

    for km in answers.range.values:
        for way in answers.super_resolution.values if km > 25 else ("none",):
            selected = answers.correct.sel(range=km, super_resolution=way)
            row = add(f"ACN, {km:g} km, {way}", selected.squeeze(drop=True))
            for value in spreads if way == "none" else ():
                share = detected.probability.sel(range=km, aspect_bin="overall")
                index = {axis_of(share): np.flatnonzero(share.target_spread == value)[0]}
                row[f"found_{value:g}"] = f"{100 * float(share.isel(index).mean()):.0f}"
    far = fused.correct.sel(range=100)
    for way in ("none", "shifted"):
        for channel in far.channel.values:
            if channel != "range" or way == "none":
                channel_words = {"range": "profile"}.get(channel, f"{channel}, {way}")
                selected = far.sel(channel=channel, super_resolution=way).squeeze(drop=True)
                add(f"likelihood of {channel_words}, 100 km", selected)
    headings = [
        *(("bins", "0-27° / 30-57° / 60-90° [%]"), ("all", "overall [%]")),
        ("found", "detected [%]"),
    ]
    return Report(
        "Silhouettes with a spread of the temperatures of ship and sea, and without",
        (
            Column("what", "16 frames"),
            *(
                Column(f"{key}_{value:g}", f"{value:g} K: {heading}")
                for value in spreads
                for key, heading in headings
            ),
        ),
        rows,
        [
            f"`ncti-sweep {' '.join(arguments)}` and `ncti-sweep {' '.join(together)}`. Percent "
            "correct ± two standard errors of the mean over draws."
        ],
    )


def axis_of(values: xr.DataArray) -> str:
    """Return the dimension along which the spread of temperatures runs."""
    (dim,) = values.target_spread.dims
    return str(dim)


def protocol(fresh: int = 10, replicates: int = 8) -> Report:
    """Compare the article's protocol with aspects absent from training."""
    common = [
        *("sensor=both", f"classifier.name=[{','.join(CLASSIFIERS)}]", "grid.frame_count=16"),
        *(f"grid.replicate={replicates}", "infrared.range=[25,50]", "infrared.vigilance=0.87"),
        *("infrared.frame_count=16", "infrared.super_resolution=none"),
    ]
    groups = [f"classification/{name}" for name in (*CLASSIFIERS, "acn_infrared")]
    commands = [
        [*common, "classifier.learn_in_test=[true,false]"],
        [*common, f"grid.random_aspects={fresh}"],
    ]
    regular, drawn = (sweep_groups(command, groups).values() for command in commands)
    rows: list[dict[str, Any]] = []
    for name, learned, random in zip(groups, regular, drawn, strict=True):
        new = ~np.isin(random.aspect.values, learned.aspect.values)
        for km in np.atleast_1d(learned.range.values):
            classifier_words = name.partition("/")[2].replace("_infrared", " on silhouettes")
            row = {"what": f"{classifier_words}, {km:g} km"}
            answers = {
                "off": learned.correct,
                "random": random.correct.isel(aspect=new),
            }
            if "learn_in_test" in learned.dims:
                answers["on"] = learned.correct.sel(learn_in_test=True)
                answers["off"] = learned.correct.sel(learn_in_test=False)
            for key, correct in answers.items():
                chosen = correct.sel(range=km) if "range" in correct.dims else correct
                chosen = chosen.squeeze(drop=True)
                row[key] = format_errors(*mean_and_error(percent(chosen)))
                row[key] += "; overall " + format_errors(*mean_and_error(overall_percent(chosen)))
            rows.append(row)
    return Report(
        "Training aspects and aspects absent from training",
        (
            Column("what", "16 frames, 30 ns"),
            Column("on", "learned aspects, learning on in the test (article's protocol) [%]"),
            Column("off", "learned aspects, learning off [%]"),
            Column("random", "random aspects, learning off [%]"),
        ),
        rows,
        [
            " and ".join(f"`ncti-sweep {' '.join(command)}`" for command in commands)
            + ". Percent correct "
            "by bin, ± two standard errors of the mean over draws. Templates every 3°."
        ],
    )


def near_stern(overrides: Sequence[str] = FLIGHTS) -> Report:
    """Return the features of Figure 16: due to the models, and due to the flight."""
    (flights,) = sweep_groups(overrides, ["validation"]).values()
    flights = flights.squeeze(drop=True)
    rows: list[dict[str, Any]] = []
    for name in ASSUMED_PARAMETERS:
        row = {"what": flights[name].attrs["long_name"]}
        for ship in ("duncan", "roberts"):
            of_ship = flights[name].sel(ship=ship)
            row[f"model_{ship}"] = f"{float(of_ship.sel(source='noiseless').mean()):.2f}"
            change = of_ship.sel(source="measured") - of_ship.sel(source="noiseless")
            row[f"flight_{ship}"] = format_mean(change)
        rows.append(row)
    for ship in ("duncan", "roberts", "connole"):
        row = {"what": f"correlation with the noiseless {ship}"}
        model = flights.profile.sel(ship=ship, source="noiseless").isel(replicate=0)
        for flown in ("duncan", "roberts"):
            noiseless = flights.profile.sel(ship=flown, source="noiseless").isel(replicate=0)
            row[f"model_{flown}"] = f"{best_correlation(noiseless.values, model.values):.3f}"
            measured = flights.profile.sel(ship=flown, source="measured")
            likeness = [
                best_correlation(profile.values, model.values)
                for profile in measured.transpose("replicate", ...)
            ]
            row[f"flight_{flown}"] = format_mean(xr.DataArray(likeness, dims="replicate"), 3)
        rows.append(row)
    for name in TILTS:
        if name in flights:
            row = {"what": f"{name.replace('_', ' ')}, largest of the draws [deg]"}
            for ship in ("duncan", "roberts"):
                row[f"flight_{ship}"] = f"{float(abs(flights[name].sel(ship=ship)).max()):.2f}"
            rows.append(row)
    return Report(
        "Near the stern: similarity of the models, and changes by a flight",
        (
            Column("what", "figure"),
            *(
                Column(f"{kind}_{ship}", f"{ship.title()}, {words}")
                for ship in ("duncan", "roberts")
                for kind, words in (("model", "noiseless"), ("flight", "flown"))
            ),
        ),
        rows,
        [
            f"`ncti-sweep {' '.join(overrides)}`. Landmarks: flown less noiseless. Mean ± two "
            f"standard errors of {flights.sizes['replicate']} draws. Correlations are the best "
            f"within shifts of {MAX_SHIFT} m. Of the Duncan's {len(components('duncan'))} "
            f"components {len(components('duncan') & components('roberts'))} are repeated in the "
            "Roberts's sheet."
        ],
    )


def components(ship: str) -> set[str]:
    """Return the lines of a ship's sheet that are components."""
    text = (Path(ncti.ships.__file__).parent / "sheets" / f"{ship}.yaml").read_text("utf-8")
    return {line.strip() for line in text.splitlines() if line.strip().startswith("- {name")}


def format_mean(draws: xr.DataArray, digits: int = 2) -> str:
    """Return the mean of some draws with two standard errors."""
    mean, error = mean_and_error(draws)
    return f"{float(mean):+.{digits}f} ± {2 * float(error):.{digits}f}"


def best_correlation(first: Floats, second: Floats) -> float:
    """Return the highest correlation of two profiles shifted against each other."""
    shifts = range(-MAX_SHIFT, MAX_SHIFT + 1)
    return max(float(profile_correlation(np.roll(first, shift), second)) for shift in shifts)


Said = tuple[str, str, str, str]  # figure, what, the article's words, ours


def figures(replicates: int = 8) -> Report:
    """Compare the article's statements on its Figures 3, 4, 5, 19 and 20 with ours."""
    profiles_of = [
        *("grid.frame_count=[1,4,8,16]", f"grid.replicate={replicates}"),
        *("ladar.target_free_ifovs=[0,4000]", "ladar.place=corner"),  # noise alone, not the place
    ]
    silhouettes_of = [*INFRARED, "grid.range=25", "infrared.super_resolution=none"]
    profiles, formed = sweep_groups(profiles_of, ["range_profile", "classification/acn"]).values()
    (clustered,) = sweep_groups(silhouettes_of, ["classification/acn_infrared"]).values()
    profiles, formed = (dataset.squeeze(drop=True) for dataset in (profiles, formed))
    expected = xr.apply_ufunc(
        profile_vector,
        profiles.expected.sel(target_free_ifovs=4000),
        input_core_dims=[["down_range"]],
        output_core_dims=[["down_range"]],
    )
    statements = [
        sensor(),
        depth_statement(expected.sel(ship="duncan")),
        likeness_statement(expected.sel(aspect=30)),
        noise_statement(profiles.sel(ship="duncan", aspect=30)),
        shared_categories(formed.sel(target_free_ifovs=4000)),
        shared_by_bin(clustered),
    ]
    names = ("figure", "what", "source", "ours")
    return Report(
        "The article's statements on its figures, and ours measured",
        tuple(Column(name, name) for name in names),
        [dict(zip(names, statement, strict=True)) for statement in statements],
        [
            f"`ncti-sweep {' '.join(profiles_of)}`, `ncti-sweep {' '.join(silhouettes_of)}`. "
            f"30 ns, 100 km and 16 frames unless stated; noise: {replicates} draws; Figure 19: "
            "the grid's own order of presentation; Figure 20: means ± two standard errors over "
            "phases and orders."
        ],
    )


def depth_statement(profiles: xr.DataArray) -> Said:
    """Return the statement of Figure 3 on a ship's expected profiles from bow to beam."""
    lengths = [depth(profiles.sel(aspect=aspect)) for aspect in (0, 30, 60, 90)]
    return (
        "Figure 3",
        "depth of the Duncan at 0, 30, 60, 90°, above 5 % of the peak",
        "deep at the bow, little abeam",
        ", ".join(f"{length:g}" for length in lengths) + " m",
    )


def likeness_statement(profiles: xr.DataArray) -> Said:
    """Return the statement of Figure 4 on (ship, down_range) expected profiles at one aspect."""
    pairs = np.corrcoef(profiles.values)[np.triu_indices(len(profiles), 1)]
    return (
        "Figure 4",
        "correlation of two ships at 30°, lowest to highest",
        "distinguishable",
        f"{pairs.min():.2f} to {pairs.max():.2f}",
    )


def noise_statement(profiles: xr.Dataset) -> Said:
    """Return the statement of Figure 5 on averages of a view, by number of frames."""
    peak = profiles.expected.max("down_range") - profiles.expected.min("down_range")
    off = (profiles.averaged - profiles.expected) ** 2
    rms = 100 * np.sqrt(off.mean(("replicate", "down_range"))) / peak
    return (
        "Figure 5",
        "rms noise of 1, 4, 8, 16 frames over the peak, Duncan at 30°",
        "speckle dominates below eight frames",
        "; ".join(
            ", ".join(f"{value:.0f}" for value in rms.sel(target_free_ifovs=free).values)
            + f" % at G = {free}"
            for free in rms.target_free_ifovs.values
        ),
    )


def shared_categories(formed: xr.Dataset) -> Said:
    """Return the statement of Figure 19 on views in categories that ships share, by aspect."""
    first = []
    for ship in formed.ship.values:
        confused = formed.training_confused.sel(ship=ship) == 1
        aspects = formed.aspect.values[confused.values]
        first.append(f"{ship} {aspects.min():g}°" if aspects.size else f"{ship} none")
    before, beyond = (
        100 * float((formed.training_confused.isel(aspect=mask) == 1).mean())
        for mask in (formed.aspect.values < 50, formed.aspect.values >= 50)
    )
    return (
        "Figure 19",
        "first aspect at which a ship shares a category; views that do below 50° and beyond",
        "about 50°; none, most",
        f"{', '.join(first)}; {before:.0f}, {beyond:.0f} %",
    )


def shared_by_bin(formed: xr.Dataset) -> Said:
    """Return the statement of Figure 20 on views in categories that ships share, by bin."""
    share = percent((formed.training_confused == 1).where(formed.training_confused >= 0, -1))
    return (
        "Figure 20",
        "views in shared categories, by bin",
        "confused at 0-30°",
        format_errors(*mean_and_error(share.squeeze(drop=True))) + " %",
    )


def depth(profile: xr.DataArray) -> float:
    """Return the distance between the ends of a profile above 5 % of its peak [m]."""
    above = profile.down_range.values[profile.values > 0.05 * float(profile.max())]
    return float(above.max() - above.min())


def sensor() -> Said:
    """Return Table 1 at 50 and 100 km, from its attenuations and its contrast at 25 km."""
    table = article_figures()["table1_sensor"]["ranges"]
    loss = {km: float(entry["attenuation_db"]) for km, entry in table.items()}
    contrast = {
        km: float(table[25]["contrast_k"]) * 10 ** ((loss[25] - loss[km]) / 20) for km in loss
    }
    pairs = [f"{contrast[km]:.2f} K, {(contrast[km] / 0.1) ** 2:.1f}" for km in (50, 100)]
    printed = [f"{table[km]['contrast_k']} K, {table[km]['snr']}" for km in (50, 100)]
    quantities = (
        "contrast and SNR at 50; 100 km from the contrast at 25 km, the attenuation and 0.1 K"
    )
    return "Table 1", quantities, "; ".join(printed), "; ".join(pairs)
