"""Sweep of one function over a grid of values, without declarations."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from platformdirs import user_cache_path

from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.code import place_of
from sweeps.engine.errors import ConfigurationError, DeclarationError, SweepIncomplete
from sweeps.engine.kinds import Count, Kind, Number, Switch, Text
from sweeps.engine.places import where
from sweeps.engine.run import Place
from sweeps.engine.run import sweep as run
from sweeps.engine.schedule import Watch
from sweeps.engine.settings import DIMENSION, Cluster, Run, Setting, read_choices
from sweeps.engine.stage import RNG, Experiment, Group, Output, Stage
from sweeps.engine.store import zarr_store

if TYPE_CHECKING:
    import xarray as xr


def sweep(
    function: Callable[..., Any],
    values: Mapping[str, Iterable[Any]],
    *,
    store: str | Path,
    dims: tuple[str, ...] = (),
    dtype: str = "f8",
    seed: int = 0,
    cluster: str = "inline",
    cache: str | Path | None = None,
    version: str = "",
) -> xr.Dataset:
    """Return the results of a function for all combinations of some values, as in its store.

    What was computed before, in this or another process, is not computed again: a sweep that was
    interrupted is resumed, and one of more values extends its store.

    Parameters
    ----------
    function : callable
        Its arguments are those named in `values`, further ones with a default, and `rng`, a
        generator of random numbers of its own for each combination. A lambda, a method, a
        `functools.partial`, a decorated function and one of a notebook are as good as any.
    values : mapping of str to iterable
        Values of each argument: numbers, whole numbers, texts, or truth values.
    store : path
        Folder of the store, in zarr's format, or URL of a bucket such as 's3://bucket/x.zarr'.
    dims : tuple of str
        Names of the dimensions of an array that the function returns; none for a number.
    dtype : str
        Of the result.
    seed : int
        Of all random numbers.
    cluster : str
        `inline`, this process, or `local`, a process on every core; a script that uses these
        begins its work under ``if __name__ == "__main__":``.
    cache : path, optional
        Place of finished results; the user's cache folder when not given. A store grows by what
        this has.
    version : str
        Counts instead of the function's code, if it is given: change it when results change.

    Returns
    -------
    Dataset
        In memory: one variable, named after the function, with a dimension for each argument.

    Raises
    ------
    ConfigurationError
        If a value, an argument or the store cannot be used, or the function holds what has no
        content to compare, such as an open file.
    SweepIncomplete
        If some calls failed. All others are in the store, and these are tried again next time.

    Notes
    -----
    A result is reused while all that it depends on is the same, as it is when the sweep begins: the
    values; the function's code, defaults and closure; each global that it names, functions and
    classes of its file in the same way, other values by content; the modules of its package, and
    those that are installed nowhere, by their code; and the versions of installed packages.

    No rule sees a file that is read, the clock, an environment variable, what `input` or a server
    returns, or what an import does besides. Give what they say as an argument or a global (the
    content of the file, or its hash), or change `version`. A global that the function itself
    changes, such as a list that it appends to, is another one in the next sweep, which computes all
    again.
    """
    if not callable(function):
        raise ConfigurationError(f"function is {function!r}, but must be what can be called")
    module, qualified = place_of(function)
    name = qualified.rpartition(".")[2]
    name = name if name.isidentifier() else "result"
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:
        what = f"function is {name}, of which Python does not tell the arguments"
        raise ConfigurationError(f"{what}; call it in a function of your own") from None
    settings = {one: _setting(f"{name}.{one}", given) for one, given in values.items()}
    known = [one.name for one in parameters if one.kind is not one.POSITIONAL_ONLY]
    if unknown := [setting for setting in settings if setting not in known]:
        raise ConfigurationError(f"values has {unknown[0]!r}, but {name} takes {', '.join(known)}")
    result = Output(name, dims, dtype, label=name)
    stage = Stage(name, function, (result,), reads=settings, group=Group(name), version=version)
    if lacking := [argument for argument in stage.arguments if argument not in (*settings, RNG)]:
        raise ConfigurationError(f"values lacks {lacking[0]!r}, which {name} takes")
    packages = (module.partition(".")[0],)
    try:
        experiment = Experiment(name, name, (*settings.values(), stage), code=packages)
    except DeclarationError as error:
        raise ConfigurationError(str(error)) from None
    given = {Run.seed.key: seed, Cluster.kind.key: cluster}
    choices = read_choices(experiment.declared, given)
    at = where("store", store)
    packs = where("cache", cache) if cache else user_cache_path("sweeps")
    place = Place(at, packs, ClusterChoice(cluster))
    finished = run(experiment, choices, place, Watch(lambda sentence: None))
    if finished.failures:
        what, why = finished.failures[0]
        raise SweepIncomplete(f"{len(finished.failures)} calls failed; {what}: {why}")
    import xarray as xr  # slow to import

    return xr.open_zarr(zarr_store(at), group=name, chunks=None).load()


def _setting(key: str, given: Iterable[Any]) -> Setting:
    """Return the setting of an argument, whose default are its values."""
    listed = [one.item() if hasattr(one, "item") else one for one in given]
    kinds: dict[type, Kind] = {bool: Switch(), int: Count(low=-math.inf), str: Text()}
    fitting = (kind for of, kind in kinds.items() if all(isinstance(one, of) for one in listed))
    kind = next(fitting, Number())
    return Setting(kind, listed, key.rpartition(".")[2], single=DIMENSION, key=key)
