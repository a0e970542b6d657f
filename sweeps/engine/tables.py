"""Tables of a store, computed from its groups before these are written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.plan import Plan
from sweeps.engine.zarr_array import Array, Group

if TYPE_CHECKING:
    import xarray as xr


def add_tables(plan: Plan, groups: dict[str, Group]) -> None:
    """Add to the groups of a store, by path, all tables computed from them.

    Variables that a table uses stay in memory, and are not read again when they are written.
    """
    for table in plan.experiment.tables:
        if all(name in groups for name in table.of) and table.when(plan.choices):
            given = [dataset_of(groups[name]) for name in table.of]
            made = table.make(*given, plan.choices)
            if made is not None:
                groups[table.group] = group_of(made)


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
