"""Vectors, labels and groups of a sweep's store, as its classifiers take them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require_word
from ncti.data.vectors import VECTORS, Vectors, groups_of, to_numpy

if TYPE_CHECKING:
    import xarray as xr

ROWS = ("dataset", "dataset_infrared")
"""Groups of a store of rows of `ncti.dataset`, for the laser radar and the imager."""

AT_ONCE = 20_000  # rows read from a store at once, so that a million need little more memory
PREFIX = "row_"  # of parameters of rows in a store
DRAWS = ("replicate", "phase")  # dimensions over independent draws of one condition
ROW_TYPES = {"frames": np.int64, "ship": np.intp, "silhouette": np.uint8}
"""Types of numbers that a store may keep in another type."""

STORE_SPLITS = ("train", "learned", "test", "unknown")
CLASSIFIERS = "classification/{}"  # groups of their answers
KEEP_FLOOR = ("likelihood", "mnn")  # classifiers that take averages, floor included


class Signatures(NamedTuple):
    """Signatures of a sensor in a store: variables of a group, and its distinctive dimension."""

    learned: str
    measured: str
    kind: str
    axes: tuple[str, ...]
    dimension: str


LAYOUTS = {
    "range_profile": Signatures("expected", "averaged", "profile", ("down_range",), "pulse_width"),
    "infrared": Signatures(
        "template_log_polar", "log_polar", "silhouette", ("angle", "radius"), "super_resolution"
    ),
}
"""Signatures by the sensor's group."""


def load_xy(
    store: str | Path, classifier_group: str | None = None, split: str = "train", **where: Any
) -> Vectors:
    """Return the vectors of a sweep's views, their ships, and groups.

    Parameters
    ----------
    store : str or Path
        Store of a sweep.
    classifier_group : str, optional
        A classifier of one sensor, as ``acn`` or ``acn_infrared``, or a sensor, ``range_profile``
        or ``infrared``; the first of these that is in the store when not given.
    split : {"train", "learned", "test", "unknown"}
        `train`: training data of classifiers, expected profiles or noiseless silhouettes of the
        learned aspects of known ships; `learned`: measured ones, averages of frames, of the same
        views; `test`: measured ones at all other aspects of known ships; `unknown`: measured ones
        of ships absent from training.
    **where
        Values of dimensions, in the store's units, as ``pulse_width=30, frame_count=[16, 32]``. All
        draws of the noise are taken, one after the other; any other dimension with several values
        must be given. One that a split lacks is ignored: expected profiles have no number of
        frames.

    Returns
    -------
    X : (row, feature) ndarray
        Vectors as the classifier takes them, see `to_numpy`; of ``likelihood`` and ``mnn`` averages
        as they are stored, floor included. Views that failed are left out.
    y : (row,) str ndarray
        Names of the ships.
    groups : (row,) int64 ndarray
        Number of the view, a ship at an aspect, the same in every split.

    Raises
    ------
    ValueError
        If there is no such store, group or value, a required dimension is missing, or the split has
        no views.

    See Also
    --------
    open_rows : Rows of a data set's store.
    to_numpy : The same of rows of `ncti.dataset`.

    Notes
    -----
    The coordinates `learned` of aspects and `known` of ships tell the learned views. A store
    of rows, of ``ncti-sweep +experiment=dataset``, has one split, `train`.

    Examples
    --------
    >>> import ncti
    >>> ncti.load_xy("no.zarr")
    Traceback (most recent call last):
    ValueError: store is 'no.zarr', which does not exist
    """
    require_word("split", split, STORE_SPLITS)
    if has_rows(store):
        if split != "train":
            raise ValueError(f"split is {split!r}, but a store of rows has no splits; omit it")
        if classifier_group is not None:
            raise ValueError(
                f"classifier_group is {classifier_group!r}, but must be None: rows have no "
                "classifiers"
            )
        # One piece is read at once, a whole store block by block.
        return _vectors(open_rows(store, chunks=None if "piece" in where else {}, **where))
    sensor = _find_sensor(store, classifier_group)
    group = _open_group(store, sensor)
    if group is None:
        raise ValueError(f"classifier_group is {classifier_group!r}, but the store lacks {sensor}")
    layout = LAYOUTS[sensor]
    views = _select_views(group, where)
    if views.learned.ndim > 1:
        spacing = next(str(dim) for dim in views.learned.dims if dim != "aspect")
        raise ValueError(f"{spacing} is not given, but must be: the aspects learned depend on it")
    # Ships and aspects of the split, so that nothing else is read.
    known, learned = views.known.values, views.learned.values
    aspects = {"test": ~learned, "unknown": learned | ~learned}.get(split, learned)
    ships = ~known if split == "unknown" else known
    if not (ships.any() and aspects.any()):
        raise ValueError(f"split is {split!r}, but {EMPTY_REASONS[split]}")
    name = layout.learned if split == "train" else layout.measured
    signatures = views[name].isel(ship=np.flatnonzero(ships), aspect=np.flatnonzero(aspects))
    axes = layout.axes
    for dim in signatures.dims:
        if dim not in ("ship", "aspect", *axes, *DRAWS, *where) and signatures.sizes[dim] > 1:
            listed = ", ".join(map(str, signatures[dim].values[:20]))
            raise ValueError(
                f"{dim} is not given, but must be one of {listed}, or a list of these: what "
                "vectors mean depends on it"
            )
    rows = signatures.stack(row=[d for d in signatures.dims if d not in axes], create_index=False)
    rows = rows.transpose("row", *axes)
    values = rows.values
    valid = (values == values) if layout.kind == "profile" else (values >= 0)  # NaN, or -1
    valid = valid.reshape(len(values), -1).all(axis=1)
    view_indices = [
        group.get_index(key).get_indexer(rows[key].values[valid]) for key in ("ship", "aspect")
    ]
    groups = np.ravel_multi_index(view_indices, (group.sizes["ship"], group.sizes["aspect"]))
    return (
        _classifier_vectors(values[valid], layout.kind, classifier_group),
        rows.ship.values[valid].astype(str),
        groups.astype(np.int64),
    )


def open_rows(
    store: str | Path, *, chunks: dict[str, int] | None = None, **where: Any
) -> xr.Dataset:
    """Return the rows of a store of ``ncti-sweep +experiment=dataset``, as `dataset` does.

    Parameters
    ----------
    store : str or Path
        Store whose groups have dimensions `piece` and `place`, the place of a row in a piece.
    chunks : dict, optional
        As of `xarray.open_dataset`: with ``{}`` nothing is read before it is used.
    **where
        Values of other dimensions, if the store has any.

    Returns
    -------
    xarray.Dataset
        Variables and coordinates of `dataset`, the same to the bit. Rows of pieces that are not
        there yet are left out.

    Raises
    ------
    ValueError
        If it is not such a store, or `where` lacks the value of another dimension.

    See Also
    --------
    dataset : The rows themselves.
    load_xy : Their vectors.

    Examples
    --------
    >>> from ncti.data import open_rows
    >>> open_rows("no.zarr")
    Traceback (most recent call last):
    ValueError: store is 'no.zarr', which does not exist
    """
    import xarray as xr

    groups = _open_groups(store, ROWS, chunks)
    parts = [_flatten_pieces(_select_views(group, where)) for group in groups]
    if not parts:
        raise ValueError(f"store is {str(store)!r}, but must have a group {' or '.join(ROWS)}")
    return xr.merge(parts, compat="override", join="inner")


def has_rows(store: str | Path) -> bool:
    """Return whether a store holds rows; `ValueError` if it is no store of a sweep."""
    return any(True for _ in _open_groups(store, ROWS))


def list_ships(store: str | Path) -> list[str]:
    """Return the names of a store's ships, known or not."""
    return next(_open_groups(store, (*ROWS, *LAYOUTS))).ship.values.astype(str).tolist()


def count_rows(store: str | Path) -> dict[int, int]:
    """Return the completed pieces of a store of rows, and the number of rows of each."""
    group = next(_open_groups(store, ROWS))
    other = [dim for dim in group.row_view.dims if dim != "piece"]
    counts = (group.row_view >= 0).sum(other).values.tolist()
    return {k: n for k, n in zip(group.piece.values.tolist(), counts, strict=True) if n}


def _vectors(rows: xr.Dataset) -> Vectors:
    """Convert lazily loaded rows by `to_numpy`, with one block in memory at a time."""
    coords = rows.drop_vars([*rows.data_vars]).load()
    vectors = None
    for start in range(0, rows.sizes["row"], AT_ONCE):
        block = slice(start, start + AT_ONCE)
        block_vectors, *_ = to_numpy(rows.isel(row=block).load())
        if vectors is None:
            vectors = np.empty((rows.sizes["row"], block_vectors.shape[1]), block_vectors.dtype)
        vectors[block] = block_vectors
    if vectors is None:
        return to_numpy(rows.load())
    return vectors, coords.ship.values.astype(str), groups_of(coords)


def _flatten_pieces(pieces: xr.Dataset) -> xr.Dataset:
    """Return the rows of all pieces, with the names and types of `dataset`."""
    import xarray as xr

    other = [name for name in pieces.row_view.dims if name not in ("piece", "place")]
    if any(pieces.sizes[name] > 1 for name in other):
        raise ValueError(f"{other[0]} is not given, but must be: the store has rows for each value")
    pieces = pieces.isel(dict.fromkeys(other, 0), drop=True).drop_vars(["rows", "piece"])
    names = pieces.ship.values.astype(str)
    rows = pieces.drop_vars("ship").stack(row=["piece", "place"], create_index=False)
    rows = rows.isel(row=np.flatnonzero(rows.row_view.values >= 0)).transpose("row", ...)
    # Parameters of rows become coordinates.
    arrays = {str(k).removeprefix(PREFIX): values.variable for k, values in rows.data_vars.items()}
    arrays |= {k: arrays[k].astype(dtype) for k, dtype in ROW_TYPES.items() if k in arrays}
    arrays["ship"] = arrays["ship"].copy(data=names[arrays["ship"].values])
    signatures = {k: arrays.pop(k) for k in list(arrays) if f"{PREFIX}{k}" not in rows}
    bins = {str(k): values.variable for k, values in rows.coords.items() if values.ndim}
    return xr.Dataset(signatures, {**bins, **arrays})


EMPTY_REASONS = {
    "train": "the store has no learned view",
    "learned": "the store has no learned view",
    "test": "the sweep learned every aspect; use 'learned', or set classifier.training_aspect",
    "unknown": "the sweep learned every ship; set classifier.unknown",
}
"""Reasons why a split has no views."""


def _classifier_vectors(values: NDArray[Any], kind: str, classifier: str | None) -> NDArray[Any]:
    """Return signatures as the vectors that a classifier takes."""
    if kind == "silhouette":
        return VECTORS[kind](values.astype(np.uint8))
    keeps_floor = classifier is not None and classifier.removeprefix(CLASSIFIERS[:-2]) in KEEP_FLOOR
    return values if keeps_floor else VECTORS[kind](values)


def _open_groups(
    store: str | Path, names: Iterable[str], chunks: dict[str, int] | None = None
) -> Iterator[xr.Dataset]:
    """Yield the named groups that exist in a store."""
    groups = (_open_group(store, name, chunks) for name in names)
    return (group for group in groups if group is not None)


def _open_group(
    store: str | Path, group: str, chunks: dict[str, int] | None = None
) -> xr.Dataset | None:
    """Return a group of a store with undecoded integers; None if there is no such group."""
    import xarray as xr

    try:
        return xr.open_dataset(
            store, group=group, engine="zarr", mask_and_scale=False, chunks=chunks
        )
    except KeyError:
        return None
    except (OSError, ValueError, TypeError) as error:
        if "://" not in str(store) and not Path(store).exists():
            raise ValueError(f"store is {str(store)!r}, which does not exist") from None
        raise ValueError(f"store is {str(store)!r}, but must be a store of a sweep") from error


def _find_sensor(store: str | Path, classifier: str | None) -> str:
    """Return the group of the sensor whose signatures a classifier takes."""
    if classifier is None:
        return next(
            (name for name in LAYOUTS if _open_group(store, name) is not None), "range_profile"
        )
    if classifier in LAYOUTS:
        return classifier
    answers = _open_group(store, CLASSIFIERS.format(classifier.removeprefix(CLASSIFIERS[:-2])))
    sensors = [
        name
        for name, layout in LAYOUTS.items()
        if answers is not None and layout.dimension in answers.coords
    ]
    if len(sensors) != 1:
        raise ValueError(
            f"classifier_group is {classifier!r}, but must be {' or '.join(LAYOUTS)}, or a "
            "classifier of the store that takes one of them"
        )
    return sensors[0]


def _select_views(views: xr.Dataset, where: dict[str, Any]) -> xr.Dataset:
    """Return the views with the given values of dimensions, without dropping any dimension."""
    for name, value in where.items():
        if name not in views.coords:
            raise ValueError(
                f"{name} is no dimension, but must be among {', '.join(map(str, views.coords))}"
            )
        values = np.atleast_1d(views[name].values)
        chosen = np.atleast_1d(value)
        if not np.isin(chosen, values).all():
            raise ValueError(
                f"{name} is {value!r:.60}, but must be among {', '.join(map(str, values[:20]))}"
            )
        if views[name].ndim:
            views = views.isel({name: np.flatnonzero(np.isin(values, chosen))})
    return views
