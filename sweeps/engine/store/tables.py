"""Tables of a store, computed from its groups before these are written."""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any

import xarray as xr
from numpy.typing import NDArray
from xarray.backends import BackendArray
from xarray.core.indexing import (
    ExplicitIndexer,
    IndexingSupport,
    LazilyIndexedArray,
    explicit_indexing_adapter,
)

from sweeps.engine.cache.packs import raise_resource_error
from sweeps.engine.declare.display import ATTRIBUTE
from sweeps.engine.declare.errors import DeclarationError, locate
from sweeps.engine.declare.failures import RAISED, Failure, format_traceback, one_line
from sweeps.engine.declare.paths import PathOrUrl
from sweeps.engine.declare.settings import Choices
from sweeps.engine.declare.stage import Table
from sweeps.engine.declare.storable import decode_attrs
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.tasks import DamagedResultsError
from sweeps.engine.store.arrays import BOTH, SCALARS, Array, ArrayGroup, metadata
from sweeps.engine.store.writing import zarr_store

MAX_ROWS = 20  # rows of a table at the end of a sweep


def add_tables(plan: Plan, groups: dict[str, ArrayGroup]) -> list[Failure]:
    """Add to the groups of a store, by path, all tables computed from them.

    Variables that a table uses stay in memory, and are not read again when they are written.
    Returns the tables that failed, by names such as `table tables/best`.
    """
    failed: dict[str, Failure] = {}
    for table in plan.experiment.tables:
        name = f"table {table.group}"
        if failed_inputs := [group for group in table.of if f"table {group}" in failed]:
            failed[name] = Failure(name, f"needs table {failed_inputs[0]}, which failed")
        if name in failed or not all(group in groups for group in table.of):
            continue
        try:
            if table.when(plan.choices):
                dataset = _make_table(table, groups, plan.choices)
                if dataset is not None:
                    groups[table.group] = from_dataset(dataset)
        except (DamagedResultsError, DeclarationError):  # the cells are at fault, not the table
            raise
        except RAISED as error:
            raise_resource_error(error)
            failed[name] = Failure(name, one_line(error), traceback=format_traceback(error))
    return list(failed.values())


def _make_table(
    table: Table, groups: Mapping[str, ArrayGroup], choices: Choices
) -> xr.Dataset | None:
    """Return the data set of a table with its displays; None if it is empty."""
    datasets = [to_dataset(groups[group]) for group in table.of]
    dataset = table.make(*datasets, choices)
    if not isinstance(dataset, xr.Dataset | None):
        kind = type(dataset).__name__
        raise TypeError(f"its function returned a {kind}, but must return a data set or None")
    if dataset is None and not _returns_value(table.make):
        sentence = "its function has no return, but must return a data set or None"
        raise TypeError(locate(table.make, sentence))
    if dataset is not None and table.displays:
        displays = [display.as_attribute(choices) for display in table.displays]
        return dataset.assign_attrs({ATTRIBUTE: displays})
    return dataset


def _returns_value(function: Callable[..., Any]) -> bool:
    """Return whether a function returns a value anywhere; True if its source is unknown."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        return True
    returns = [node.value for node in ast.walk(tree) if isinstance(node, ast.Return)]
    return any(returns) or not isinstance(tree.body[0], ast.FunctionDef)


def format_tables(path: PathOrUrl, groups: Iterable[str]) -> Iterator[str]:
    """Yield the tables of a store as text, eliding the middle of long ones."""
    for name in groups:
        with suppress(KeyError, FileNotFoundError):  # a table that is empty or failed
            table = xr.open_zarr(zarr_store(path), group=name, consolidated=False)
            table = table.drop_vars(
                [coordinate for coordinate in table.coords if not table[coordinate].dims]
            )
            units = {
                variable: table[variable].attrs.get("units", "1") for variable in table.variables
            }
            heads = {
                variable: f"{variable} [{unit}]" for variable, unit in units.items() if unit != "1"
            }
            head = table.isel({dim: slice(MAX_ROWS) for dim in table.dims})
            rows = head.to_dataframe() if table.dims else head.to_pandas().to_frame().T
            rows = rows.rename_axis(index=heads).rename(columns=heads)
            yield rows.to_string(max_rows=MAX_ROWS, float_format="{:.4g}".format)


class LazyArray(BackendArray):
    """Values of an array, all read at the first access."""

    def __init__(self, array: Array) -> None:
        self.shape, self.dtype, self._array = array.shape, array.stored_dtype, array

    def __getitem__(self, key: ExplicitIndexer) -> NDArray[Any]:
        values = self._array.load()
        return explicit_indexing_adapter(key, self.shape, IndexingSupport.BASIC, values.__getitem__)


def to_dataset(group: ArrayGroup) -> xr.Dataset:
    """Return the data set that xarray would open from a written group, read lazily."""
    variables = {  # with their dtype, else xarray makes objects of texts
        name: xr.Variable(
            array.dims,
            LazilyIndexedArray(LazyArray(array)),
            array.attributes,
            {"dtype": array.stored_dtype},
        )
        for name, array in group.arrays.items()
    }
    return xr.decode_cf(xr.Dataset(variables, attrs=group.attributes))


def restore_scalars(dataset: xr.Dataset) -> xr.Dataset:
    """Return a group of a store, with scalar coordinates restored from its attributes."""
    attrs = dict(dataset.attrs)
    attrs_by_name = decode_attrs({SCALARS: attrs.pop(SCALARS, "{}")})[SCALARS]
    scalars = {}
    for name, scalar_attrs in attrs_by_name.items():
        value = (
            attrs.get(name, math.nan) if scalar_attrs.pop(BOTH, 0) else attrs.pop(name, math.nan)
        )
        value = value == "true" if scalar_attrs.pop("dtype", "") == "bool" else value
        scalars[name] = ((), value, scalar_attrs)
    restored = dataset.assign_coords(scalars)
    restored.attrs = attrs
    return restored


def from_dataset(dataset: xr.Dataset) -> ArrayGroup:
    """Return the group of a store that holds a data set; TypeError if it cannot be stored."""
    arrays = {
        str(name): Array.from_values(
            tuple(map(str, variable.dims)),
            variable.values,
            variable.attrs,
            coordinate=name in dataset.coords,
        )
        for name, variable in dataset.variables.items()
    }
    for array in arrays.values():
        metadata(array)
    return ArrayGroup(arrays, dataset.attrs)
