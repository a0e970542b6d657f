"""Tables of a store, computed from its groups before these are written."""

from __future__ import annotations

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

from sweeps.engine.display import ATTRIBUTE
from sweeps.engine.errors import DeclarationError
from sweeps.engine.failures import RAISED, Failure, reason, traceback_of
from sweeps.engine.packs import raise_shortage
from sweeps.engine.plan import Plan
from sweeps.engine.tasks import Damaged
from sweeps.engine.zarr_array import Array, Group, metadata


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
                given = [dataset_of(groups[one]) for one in table.of]
                made = table.make(*given, plan.choices)
                if not isinstance(made, xr.Dataset | None):
                    kind = type(made).__name__
                    raise TypeError(
                        f"its function returned a {kind}, but must return a data set or None"
                    )
                if made is not None:
                    if table.displays:
                        shown = [display.written(plan.choices) for display in table.displays]
                        made = made.assign_attrs({ATTRIBUTE: shown})
                    groups[table.group] = group_of(made)
        except (Damaged, DeclarationError):  # of cells, not of the table
            raise
        except RAISED as error:
            raise_shortage(error)
            failed[name] = Failure(name, reason(error), traceback=traceback_of(error))
    return list(failed.values())


class Values(BackendArray):
    """Values of an array, which are all read when some are wanted."""

    def __init__(self, array: Array) -> None:
        self.shape, self.dtype, self._array = array.shape, array.stored, array

    def __getitem__(self, key: ExplicitIndexer) -> NDArray[Any]:
        values = self._array.whole()
        return explicit_indexing_adapter(key, self.shape, IndexingSupport.BASIC, values.__getitem__)


def dataset_of(group: Group) -> xr.Dataset:
    """Return the data set that xarray would open of a written group; variables are read lazily."""
    variables = {  # with their dtype, else xarray makes objects of texts
        name: xr.Variable(
            one.dims, LazilyIndexedArray(Values(one)), one.attributes, {"dtype": one.stored}
        )
        for name, one in group.arrays.items()
    }
    return xr.decode_cf(xr.Dataset(variables, attrs=group.attributes))


def group_of(dataset: xr.Dataset) -> Group:
    """Return the group of a store that holds a data set; TypeError if it cannot be stored."""
    arrays = {
        str(name): Array.of(
            tuple(map(str, one.dims)), one.values, one.attrs, coordinate=name in dataset.coords
        )
        for name, one in dataset.variables.items()
    }
    for array in arrays.values():
        metadata(array)
    return Group(arrays, dataset.attrs)
