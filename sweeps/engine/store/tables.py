"""Tables of a store, computed from its groups before these are written."""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Iterable, Iterator
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
from sweeps.engine.declare.storable import decode_attrs
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.tasks import DamagedResults
from sweeps.engine.store.arrays import BOTH, SCALARS, Array, Group, metadata
from sweeps.engine.store.writing import zarr_store

MAX_ROWS = 20  # of a table at the end of a sweep


def add_tables(plan: Plan, groups: dict[str, Group]) -> list[Failure]:
    """Add to the groups of a store, by path, all tables computed from them.

    Variables that a table uses stay in memory, and are not read again when they are written.
    Returns the tables that failed, by names such as `table tables/best`.
    """
    failed: dict[str, Failure] = {}
    for table in plan.experiment.tables:
        name = f"table {table.group}"
        if lost := [one for one in table.of if f"table {one}" in failed]:
            failed[name] = Failure(name, f"needs table {lost[0]}, which failed")
        if name in failed or not all(one in groups for one in table.of):
            continue
        try:
            if table.when(plan.choices):
                given = [to_dataset(groups[one]) for one in table.of]
                made = table.make(*given, plan.choices)
                if not isinstance(made, xr.Dataset | None):
                    kind = type(made).__name__
                    wrong = f"its function returned a {kind}"
                    raise TypeError(f"{wrong}, but must return a data set or None")
                if made is None and not _returns(table.make):
                    sentence = "its function has no return, but must return a data set or None"
                    raise TypeError(locate(table.make, sentence))
                if made is not None:
                    if table.displays:
                        displays = [one.as_attribute(plan.choices) for one in table.displays]
                        made = made.assign_attrs({ATTRIBUTE: displays})
                    groups[table.group] = from_dataset(made)
        except (DamagedResults, DeclarationError):  # of cells, not of the table
            raise
        except RAISED as error:
            raise_resource_error(error)
            failed[name] = Failure(name, one_line(error), traceback=format_traceback(error))
    return list(failed.values())


def _returns(function: Callable[..., Any]) -> bool:
    """Return whether a function has a statement that returns something, as far as its text says."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        return True
    returns = [one.value for one in ast.walk(tree) if isinstance(one, ast.Return)]
    return any(returns) or not isinstance(tree.body[0], ast.FunctionDef)


def format_tables(path: PathOrUrl, groups: Iterable[str]) -> Iterator[str]:
    """Yield tables of a store as texts, long ones without their middle."""
    for name in groups:
        with suppress(KeyError, FileNotFoundError):  # a table that has nothing, or failed
            table = xr.open_zarr(zarr_store(path), group=name, consolidated=False)
            table = table.drop_vars([one for one in table.coords if not table[one].dims])
            units = {one: table[one].attrs.get("units", "1") for one in table.variables}
            heads = {one: f"{one} [{unit}]" for one, unit in units.items() if unit != "1"}
            some = table.isel({dim: slice(MAX_ROWS) for dim in table.dims})
            rows = some.to_dataframe() if table.dims else some.to_pandas().to_frame().T
            rows = rows.rename_axis(index=heads).rename(columns=heads)
            yield rows.to_string(max_rows=MAX_ROWS, float_format="{:.4g}".format)


class LazyArray(BackendArray):
    """Values of an array, which are all read when some are wanted."""

    def __init__(self, array: Array) -> None:
        self.shape, self.dtype, self._array = array.shape, array.stored_dtype, array

    def __getitem__(self, key: ExplicitIndexer) -> NDArray[Any]:
        values = self._array.load()
        return explicit_indexing_adapter(key, self.shape, IndexingSupport.BASIC, values.__getitem__)


def to_dataset(group: Group) -> xr.Dataset:
    """Return the data set that xarray would open of a written group; variables are read lazily."""
    variables = {  # with their dtype, else xarray makes objects of texts
        name: xr.Variable(
            one.dims,
            LazilyIndexedArray(LazyArray(one)),
            one.attributes,
            {"dtype": one.stored_dtype},
        )
        for name, one in group.arrays.items()
    }
    return xr.decode_cf(xr.Dataset(variables, attrs=group.attributes))


def with_scalars(dataset: xr.Dataset) -> xr.Dataset:
    """Return a group of a store with the scalar coordinates that are attributes there."""
    attrs = dict(dataset.attrs)
    about = decode_attrs({SCALARS: attrs.pop(SCALARS, "{}")})[SCALARS]
    scalars = {}
    for name, given in about.items():
        value = attrs.get(name, math.nan) if given.pop(BOTH, 0) else attrs.pop(name, math.nan)
        value = value == "true" if given.pop("dtype", "") == "bool" else value
        scalars[name] = ((), value, given)
    found = dataset.assign_coords(scalars)
    found.attrs = attrs
    return found


def from_dataset(dataset: xr.Dataset) -> Group:
    """Return the group of a store that holds a data set; TypeError if it cannot be stored."""
    arrays = {
        str(name): Array.from_values(
            tuple(map(str, one.dims)), one.values, one.attrs, coordinate=name in dataset.coords
        )
        for name, one in dataset.variables.items()
    }
    for array in arrays.values():
        metadata(array)
    return Group(arrays, dataset.attrs)
