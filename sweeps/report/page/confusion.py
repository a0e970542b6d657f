"""Confusion matrices: counts by true and predicted ship, by selection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ncti.evaluate import aspect_bins
from sweeps.report.axes import DRAWS, shown
from sweeps.report.axes import Axis as SweepAxis
from sweeps.report.page.cubes import (
    BIN,
    NAMED,
    OVERALL,
    SPLIT,
    TRUE,
    Axes,
    Axis,
    Cube,
    along,
    hole,
    unit_of,
    with_unit,
)
from sweeps.report.page.layout import Cell, label_of, notes_of
from sweeps.report.rows import known

NONE = "none"


@dataclass(frozen=True)
class Matrix:
    """A confusion matrix of the page: true ships down, predicted ships across."""

    name: str
    title: str
    notes: list[tuple[str, str, str]]
    ships: list[str]
    named: list[str]
    lines: list[list[Cell]]


def matrices_of(answers: xr.Dataset, group: str, store: str, axes: Axes) -> list[Cube]:
    """Return counts of answers by true and predicted ship, a cube per value of split axes.

    Over all draws and the aspects of a bin. Empty if a group has no predictions.
    """
    if "predicted" not in answers or not {"ship", "aspect"} <= set(answers.predicted.dims):
        return []
    split = [dim for dim in SPLIT if dim in answers.predicted.dims]
    split = [dim for dim in split if answers.sizes[dim] > 1]
    stacked = [answers]
    for dim in split:
        stacked = [part.sel({dim: [value]}) for part in stacked for value in answers[dim].values]
    return [_cube(part, group, store, axes, split) for part in stacked]


def _cube(answers: xr.Dataset, group: str, store: str, axes: Axes, split: Sequence[str]) -> Cube:
    predicted = answers.predicted
    ships = [str(ship) for ship in answers.ship.values.tolist()]
    bins, index = aspect_bins(answers.aspect.values)
    labels = [*bins, OVERALL]
    draws = [str(dim) for dim in predicted.dims if dim in DRAWS]
    own = [str(dim) for dim in predicted.dims if dim not in (*draws, "ship", "aspect")]
    dims = tuple(dim for dim in own if answers.sizes[dim] > 1)
    values = predicted.transpose(*own, *draws, "ship", "aspect").values
    outer = int(np.prod(values.shape[: len(own)], dtype=int))
    values = values.reshape(outer, -1, len(ships), answers.sizes["aspect"])
    # One number for each place, bin, true and predicted ship, counted at once.
    each, named = len(ships) + 1, np.where(values < 0, len(ships), values)
    place = np.arange(outer)[:, None, None, None] * (len(labels) - 1) + index
    place = (place * len(ships) + np.arange(len(ships))[:, None]) * each + named
    counts = np.bincount(place.ravel(), minlength=outer * (len(labels) - 1) * len(ships) * each)
    counts = counts.reshape(outer, len(labels) - 1, len(ships), each)
    counts = np.concatenate([counts, counts.sum(axis=1, keepdims=True)], axis=1)

    at, fixed, there = [], {}, []
    for dim in own:
        given, codes, column = along(answers, dim)
        if dim in dims:
            axes.add(dim, column, given, codes)
            there.append(tuple(given))
            at.append(f", {dim}={hole(dim)}")
        else:
            fixed[dim] = with_unit(shown(given[0]), unit_of(column))
            at.append(f", {dim}={codes[0]}")
    named_ships = [*ships, NONE] if counts[..., -1].any() else ships
    counts = counts[..., : len(named_ships)]
    ends = [answers.aspect.values[index == k] for k in range(len(labels) - 1)]
    slices = [f", aspect=slice({float(one.min())!r}, {float(one.max())!r})" for one in ends]
    axes.add(BIN, SweepAxis(xr.DataArray(0, name=BIN)), labels, [repr(one) for one in labels])
    axes.add(TRUE, SweepAxis(xr.DataArray(0, name=TRUE)), ships, [repr(one) for one in ships])
    axes.add(
        NAMED,
        SweepAxis(xr.DataArray(0, name=NAMED)),
        [*ships, NONE],
        [*map(str, range(len(ships))), "-1"],
    )
    opened = f"xr.open_zarr({store!r}, group={group!r}).predicted"
    return Cube(
        group,
        "predicted",
        "ships named",
        "answers",
        "",
        (*dims, BIN, TRUE, NAMED),
        (*there, tuple(labels), tuple(ships), tuple(named_ships)),
        tuple(counts.ravel().tolist()),
        f"int(({opened}.sel(ship={hole(TRUE)}{''.join(at)}{hole(BIN)}) == {hole(NAMED)}).sum())",
        fixed | {dim: str(known(answers[dim].values[0])) for dim in split},
        codes={BIN: [*slices, ""]},
    )


def laid_out(cubes: Sequence[Cube], axes: Mapping[str, Axis]) -> list[Matrix]:
    """Return the matrices of a page."""
    found = []
    for number, cube in enumerate(cubes):
        if NAMED not in cube.dims:
            continue
        there, across = (cube.at[cube.dims.index(name)] for name in (TRUE, NAMED))
        name = cube.group.rpartition("/")[2]
        found.append(
            Matrix(
                name,
                label_of(cube),
                notes_of(cube, axes),
                [axes[TRUE].texts[place] for place in there],
                [axes[NAMED].texts[place] for place in across],
                [[Cell(number, {TRUE: one, NAMED: other}) for other in across] for one in there],
            )
        )
    return found
