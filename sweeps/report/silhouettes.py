"""The tables of the infrared channel as rows, ours beside the source's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import xarray as xr

from ncti.infrared import attenuation, contrast, snr
from sweeps.report.tables import RULES, Row, cells, percent, source_figures
from sweeps.tabulation import DRAWS

CHOICES = ("coverage_rule", "segmentation", "inner_radius", "interpolation", "learning_rate")

# Places of the detector at each of which the given number of frames is taken.
POSITIONS = {"none": 1, "perfect": 1, "shifted": 4}


def sensor_rows(images: xr.Dataset, configuration: Mapping[str, Any]) -> list[Row]:
    """What the air leaves of a ship's warmth (the article's Table 1).

    Parameters
    ----------
    images : xarray.Dataset
        The store's infrared group, for its ranges and numbers of frames.
    configuration : mapping
        The `infrared` part of the store's configuration.

    Returns
    -------
    list of dict
        One row a range and number of frames: attenuation, contrast, SNR, and as printed in
        the source.
    """
    source = source_figures()["table1_sensor"]
    extinction = {"extinction": configuration["extinction"] * 1e-3}
    scene = extinction | {"contrast_at_zero": configuration["contrast_at_zero"]}
    rows = []
    for slant_range in images.range.values.tolist():
        for frames in images.frame_count.values.tolist():
            metres = slant_range * 1e3
            printed = source["ranges"].get(slant_range) if frames == source["frame_count"] else None
            theirs = printed or (None, None, None)
            rows.append(
                {
                    "range_km": slant_range,
                    "frame_count": frames,
                    "attenuation_db": round(attenuation(metres, **extinction), 3),
                    "source_attenuation_db": theirs[0],
                    "contrast_k": round(contrast(metres, **scene), 4),
                    "source_contrast_k": theirs[2],
                    "snr": round(
                        snr(metres, frame_count=frames, nedt=configuration["nedt"], **scene), 3
                    ),
                    "source_snr": theirs[1],
                }
            )
    return rows


def silhouette_category_rows(tables: xr.Dataset) -> list[Row]:
    """Categories formed from silhouettes, over phases and orders of presentation.

    Parameters
    ----------
    tables : xarray.Dataset
        The store's table group.

    Returns
    -------
    list of dict
        One row for all phases and orders of a training: axes, how many of them there are,
        mean, least and most categories, the first's, number of silhouettes, whether the
        categories settled in all, and the source's count where it has one. Those that failed
        are left out.
    """
    source = source_figures()["table5_percent_correct"]
    done = tables.view_count > 0
    counted = tables.category_count.where(done)
    summary = xr.Dataset(
        {
            "trainings": done.sum(DRAWS),
            "mean": counted.mean(DRAWS),
            "least": counted.min(DRAWS),
            "most": counted.max(DRAWS),
            "first": counted.isel(dict.fromkeys(DRAWS, 0)).drop_vars(DRAWS, errors="ignore"),
            "views": tables.view_count.max(DRAWS),
            "settled": (tables.settled.where(done, 1) == 1).all(DRAWS) & done.any(DRAWS),
        }
    ).drop_vars(RULES, errors="ignore")  # categories form before they are named
    return [
        axes
        | {
            "trainings": cell["trainings"],
            "categories": _rounded(cell["mean"], 2),
            "least": _rounded(cell["least"]),
            "most": _rounded(cell["most"]),
            "of_first_phase_and_order": _rounded(cell["first"]),
            "training_silhouettes": cell["views"],
            "settled": cell["settled"],
            "source_categories": source["categories"]
            if axes["vigilance"] == source["vigilance"]
            else None,
        }
        for axes, cell in cells(summary)
    ]


def silhouette_accuracy_rows(tables: xr.Dataset) -> list[Row]:
    """Percent correct by aspect bin (the article's Table 5), training silhouettes first.

    Parameters
    ----------
    tables : xarray.Dataset
        The store's table group.

    Returns
    -------
    list of dict
        One row for each aspect bin of a training or test: axes, which silhouettes, how many
        frames are averaged, and how many that is at all places of the detector, percent
        correct over phases and orders, its Wilson interval, its standard deviation over them,
        number of views, and the source's figure.
    """
    lowest = dict(zip(tables.aspect_bin.values, tables.aspect_low.values.tolist(), strict=True))
    rows = []
    for prefix in ("training_", ""):
        names = [prefix + name for name in ("accuracy", "ci_low", "ci_high", "spread", "n")]
        for axes, cell in cells(tables[names]):
            fraction, low, high, spread, n = (cell[name] for name in names)
            label = axes.pop("aspect_bin")
            known = {
                name: axes.pop(name, None)
                for name in ("range_km", "super_resolution", "frame_count")
            }
            rules = {name: axes.pop(name, None) for name in RULES}
            rows.append(
                axes
                | {"silhouettes": "training" if prefix else "cut out"}
                | known
                | rules
                | {
                    "frames_in_all": frames_in_all(known),
                    "aspect_bin_deg": label,
                    "percent_correct": percent(fraction),
                    "ci_low": percent(low),
                    "ci_high": percent(high),
                    "spread": percent(spread),
                    "n": n,
                    "source_percent": _source_percent(axes["vigilance"], known, lowest[label]),
                }
            )
    return rows


def _source_percent(vigilance: float, known: Row, lowest: float) -> int | None:
    """The article's figure for the bin whose lowest aspect is given (NaN for all of them)."""
    source = source_figures()["table5_percent_correct"]
    if (vigilance, known["frame_count"]) != (source["vigilance"], source["frame_count"]):
        return None
    way, slant_range = known["super_resolution"], known["range_km"]
    if lowest != lowest:
        whole: int | None = source["overall"].get(way, {}).get(slant_range)
        return whole
    figures = source.get(way, {}).get(slant_range)
    if figures is None or lowest > 90:
        return None
    found: int = figures[sum(lowest >= start for start in source["bin_starts"]) - 1]
    return found


def frames_in_all(row: Row) -> int | None:
    """Frames taken for an image: shifted ones add up at each of four places."""
    frames = row["frame_count"]
    return None if frames is None else POSITIONS[row["super_resolution"]] * frames


def _finite(value: float) -> float | None:
    """A number; none of NaN or infinity."""
    return value if math.isfinite(value) else None


def _rounded(value: float, digits: int | None = None) -> float | None:
    """A number to so many digits, or a whole one; none of NaN or infinity."""
    return round(value, digits) if math.isfinite(value) else None


def detection_rows(tables: xr.Dataset) -> list[Row]:
    """Probability that the detector finds the ship, by range, frames and aspect bin."""
    return [
        {name: value for name, value in axes.items() if name != "aspect_bin"}
        | {
            "aspect_bin_deg": axes["aspect_bin"],
            "probability": _finite(cell["probability"]),
            "lowest_of_views": _finite(cell["lowest"]),
        }
        for axes, cell in cells(tables[["probability", "lowest"]])
    ]


def reconstruction_rows(tables: xr.Dataset) -> list[Row]:
    """Error of images against the noiseless image of half the pixel."""
    return [
        axes
        | {
            "frames_in_all": frames_in_all(axes),
            "error": _rounded(cell["error"], 4),
            "spread": _rounded(cell["error_spread"], 4),
        }
        for axes, cell in cells(tables[["error", "error_spread"]])
    ]
