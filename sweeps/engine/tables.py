"""Tables of a store, computed from its groups before these are written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.errors import DeclarationError
from sweeps.engine.failures import Failure, reason, traceback_of
from sweeps.engine.packs import SHORTAGES
from sweeps.engine.plan import Plan
from sweeps.engine.tasks import Damaged
from sweeps.engine.zarr_array import Array, Group, metadata

if TYPE_CHECKING:
    import xarray as xr


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
                if not (made is None or hasattr(made, "data_vars")):
                    kind = type(made).__name__
                    raise TypeError(
                        f"its function returned a {kind}, but must return a data set or None"
                    )
                if made is not None:
                    groups[table.group] = _storable(group_of(made))
        except (Damaged, DeclarationError):  # of cells, not of the table
            raise
        except Exception as error:
            if getattr(error, "errno", None) in SHORTAGES:
                raise
            failed[name] = Failure(name, reason(error), traceback=traceback_of(error))
    return list(failed.values())


def _storable(group: Group) -> Group:
    """Return a group; raise TypeError if one of its arrays cannot be stored."""
    for array in (*group.arrays.values(), *group.coordinates.values()):
        metadata(array)
    return group


def dataset_of(group: Group) -> xr.Dataset:
    """Return the data set that xarray would open of a written group; variables are read lazily."""
    import xarray as xr  # slow to import, and not every sweep has tables
    from xarray.backends.common import AbstractDataStore, BackendArray
    from xarray.core.indexing import (
        ExplicitIndexer,
        IndexingSupport,
        LazilyIndexedArray,
        explicit_indexing_adapter,
    )

    class Values(BackendArray):
        def __init__(self, of: dict[str, Array], name: str) -> None:
            self.shape, self.dtype = of[name].shape, of[name].opened
            self._of, self._name = of, name

        def __getitem__(self, key: ExplicitIndexer) -> NDArray[Any]:
            given = self._of[self._name]
            if not isinstance(given.read, np.ndarray):
                # All of it, whatever the key, in the order in which it would be read: sums
                # may depend on that in their last bit.
                whole = given.read(tuple(slice(0, size) for size in self.shape))
                given = self._of[self._name] = replace(given, read=np.ascontiguousarray(whole))
            values = np.asarray(given.read).astype(self.dtype)
            return explicit_indexing_adapter(
                key, self.shape, IndexingSupport.BASIC, values.__getitem__
            )

    class Opened(AbstractDataStore):
        def get_variables(self) -> dict[str, xr.Variable]:
            return {
                # With its dtype, else xarray makes objects of texts.
                name: xr.Variable(
                    one.dims,
                    LazilyIndexedArray(Values(of, name)),
                    one.attributes,
                    {"dtype": one.opened},
                )
                for of in (group.arrays, group.coordinates)
                for name, one in of.items()
            }

        def get_attrs(self) -> Mapping[str, Any]:
            return group.attributes

    return xr.open_dataset(Opened())


def group_of(dataset: xr.Dataset) -> Group:
    """Return the group of a store that holds a data set."""
    variables, coordinates = (
        {
            str(name): Array.of(tuple(map(str, found.dims)), found.values, found.attrs)
            for name, found in given.items()
        }
        for given in (dataset.data_vars, dataset.coords)
    )
    return Group(variables, coordinates, dataset.attrs)
