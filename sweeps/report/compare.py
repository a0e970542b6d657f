"""Two stores compared: differences of percent correct on the views that both have."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ncti.evaluate import paired_difference
from sweeps.engine.display import Display, Figure
from sweeps.engine.errors import ConfigurationError
from sweeps.report.files import csv_of
from sweeps.report.frames import Frame, Part, read_frames, stacked, tidy
from sweeps.report.own import OwnFiles
from sweeps.report.places import tables_folder
from sweeps.report.stores import opened, read
from sweeps.report.words import MAIN, printable
from sweeps.stages.scores import DRAWS, VIEW

NAME = "differences"
ANSWERS = {
    "accuracy": "correct",
    "ship_accuracy": "ship_correct",
    "training_accuracy": "training_correct",
}
"""Variables of answers by those of their scores."""


def compare(first: Path, second: Path) -> Frame:
    """Return the differences of percent correct, second store less first, with intervals.

    Answers are paired: of the settings, ships, aspects and draws that both stores have. A setting
    of one value in one store is compared with every value in the other.

    Raises
    ------
    ConfigurationError
        If a store has no tables, or the stores have no answers in common.
    """
    parts = []
    ours, theirs = ({_key(part): part for part in _scores(path)} for path in (first, second))
    for key, part in ours.items():
        if key in theirs:
            table = _differences(_answers(first, part), _answers(second, theirs[key]))
            display = Display(
                NAME,
                f"Ships identified correctly [points]: {printable(second.name)} less "
                f"{printable(first.name)}",
                (
                    Figure(
                        "difference",
                        low="ci_low",
                        high="ci_high",
                        beside={"n": "n"},
                        percent=True,
                        format="+.0f",
                    ),
                ),
                rows=("classifier", "channel", "scored"),
                columns="aspect_bin",
                labels=part.display.labels,
                notes=("Of the views that both have, with 95 % intervals of paired answers.",),
            )
            made = tidy(table, display, "") if table is not None else None
            parts += [made] if made is not None else []
    if not parts:
        raise ConfigurationError(
            f"store is {str(second)!r}, but must have answers in common with {str(first)!r}"
        )
    return stacked(parts)


def compared_name(first: Path, second: Path) -> Path:
    """Return the path of the store that a comparison is named like: `b-less-a.zarr`, beside b."""
    return second.with_name(f"{second.stem}-less-{first.stem}.zarr")


def write_comparison(first: Path, second: Path, frame: Frame) -> list[Path]:
    """Write differences as a CSV file; return the paths at which another file is in the way."""
    files = OwnFiles(tables_folder(compared_name(first, second)))
    files.put(f"{NAME}.csv", csv_of(frame))
    return files.kept


def sentences(frame: Frame) -> list[str]:
    """Return in words which classifier differs most, over all aspects."""
    at = frame.at({frame.across: MAIN["aspect_bin"]}) if frame.across else frame
    rows = at.rows[(at.rows.kind == "test") & at.rows.difference.notna()]
    sure = rows[(rows.ci_low > 0) | (rows.ci_high < 0)]
    if sure.empty:
        return [f"No difference over all aspects is larger than its interval ({len(rows)} cells)."]
    row = sure.loc[sure.difference.abs().idxmax()]
    name = frame.columns["classifier"].text(row.classifier)
    return [
        f"{len(sure)} of {len(rows)} differences over all aspects are larger than their intervals; "
        f"the largest is {row.difference:+.0f} points [{row.ci_low:+.0f} to {row.ci_high:+.0f}], "
        f"of {name}."
    ]


def _scores(path: Path) -> Iterator[Part]:
    """Yield the parts of the scores of a store. Raises ConfigurationError if it has no tables."""
    frames = read_frames(path)
    if "scores" in frames:
        yield from frames["scores"].parts


def _key(part: Part) -> tuple[Any, ...]:
    return part.group, part.display.figures[0].variable, *sorted(part.display.labels.items())


def _answers(path: Path, part: Part) -> xr.DataArray:
    """Return the answers that a part of the scores counts: 1 right, 0 wrong, negative for none."""
    group = part.group.replace("tables/", "classification/", 1)
    return read(opened(path), group)[ANSWERS[part.display.figures[0].variable]].load()


def _differences(first: xr.DataArray, second: xr.DataArray) -> xr.Dataset | None:
    """Return the differences by aspect bin of the answers in common; None without any."""
    first, second = _with_dims(first, second.dims), _with_dims(second, first.dims)
    common = xr.align(first, second, join="inner")
    one, other = xr.broadcast(*(answers.reset_coords(drop=True) for answers in common))
    draws = [dim for dim in DRAWS if dim in one.dims]
    if 0 in one.shape or not {*VIEW} <= {*one.dims}:
        return None
    one, other = (answers.transpose(..., *draws, *VIEW) for answers in (one, other))
    asked = (one.values >= 0) & (other.values >= 0)
    found = paired_difference(
        one.values == 1, other.values == 1, one.aspect.values, draws=len(draws), answered=asked
    )
    gone = (*draws, *VIEW)
    dims = (*one.dims[: -len(gone)], "aspect_bin")
    coords: dict[Any, Any] = {name: one[name] for name in dims if name in one.coords}
    coords["aspect_bin"] = np.array(found.labels)
    figures = {
        "difference": (found.fraction, "fraction of ships identified, second less first"),
        "ci_low": (found.ci_low, "lower end of its 95 % interval"),
        "ci_high": (found.ci_high, "upper end of its 95 % interval"),
        "n": (found.n, "number of pairs of answers"),
    }
    return xr.Dataset(
        {
            name: (dims, np.asarray(values), {"units": "1", "long_name": words})
            for name, (values, words) in figures.items()
        },
        coords,
    )


def _with_dims(answers: xr.DataArray, dims: Iterable[Hashable]) -> xr.DataArray:
    """Return answers with dimensions that another store has, where they have one value there."""
    return answers.expand_dims(
        [dim for dim in dims if dim in answers.coords and dim not in answers.dims]
    )
