"""Sweep of one function over a grid of values, without declarations."""

from __future__ import annotations

import inspect
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from platformdirs import user_cache_path

from sweeps.engine.declare.errors import CallsFailed, ConfigurationError, DeclarationError
from sweeps.engine.declare.failures import Failure
from sweeps.engine.declare.paths import path_or_url
from sweeps.engine.declare.settings import Cluster, Joint, Run, read_choices
from sweeps.engine.declare.stage import RNG, STATUS, VALID, Experiment, Group, Stage
from sweeps.engine.declare.undeclared import FLOAT, PADDING, Undeclared
from sweeps.engine.function.arguments import Argument, read_values
from sweeps.engine.resolve.code import module_and_name
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.process import say, show
from sweeps.engine.run.progress import NAMED_FAILURES, progress_bar
from sweeps.engine.run.schedule import Watch
from sweeps.engine.store.tables import with_scalars
from sweeps.engine.store.targets import check_targets
from sweeps.engine.store.writing import zarr_store
from sweeps.engine.sweeping import Finished, RunOptions, preview
from sweeps.engine.sweeping import sweep as run

if TYPE_CHECKING:
    import xarray as xr

CLUSTER_KINDS = ("inline", "local")
Names = str | Sequence[str]


def sweep(
    function: Callable[..., Any],
    values: Mapping[str, Iterable[Any]] | xr.Dataset,
    *,
    store: str | Path,
    outputs: Names = (),
    dims: Names | Mapping[str, Names] = (),
    attrs: Mapping[str, Mapping[str, Any]] | None = None,
    dtype: str = "",
    seed: int = 0,
    cluster: str = "inline",
    cache: str | Path | None = None,
    version: str = "",
    dry_run: bool = False,
) -> xr.Dataset:
    """Return the results of a function for all combinations of some values, as in its store.

    >>> def area(width, height):
    ...     return width * height
    >>> found = sweeps.sweep(area, {"width": [1, 2], "height": [3, 4]}, store="area.zarr")
    >>> found.area.sel(width=2, height=3).item()
    6.0

    What was computed before, in this or another process, is not computed again: a sweep that was
    interrupted is resumed, and one of more values extends its store. It runs from a script, a
    notebook or a prompt, and shows its progress in a terminal or notebook.

    Parameters
    ----------
    function : callable
        Its arguments are those named in `values`, others with a default, and `rng`, a
        generator of random numbers of its own for each combination. A lambda, a method, a
        `functools.partial`, a decorated function and one of a notebook are as good as any.
    values : mapping of str to iterable, or Dataset
        Values of each argument: numbers, whole numbers, texts, truth values or times (`datetime`,
        or numpy's). Of a data set, variables that share a dimension run together, those of
        different ones are combined, and scalars are fixed; the result has its coordinates.
    store : path
        Folder of the store, in zarr's format, or URL of a bucket such as 's3://bucket/x.zarr'.
    outputs : tuple of str
        Names of the elements of a tuple that the function returns.
    dims : tuple of str, or mapping of str to them
        Names of the dimensions of arrays that the function returns, or of each by its name. Arrays
        of different length are padded with NaN.
    attrs : mapping of str to mapping
        Attributes, such as units, of results and arguments by name.
    dtype : str
        Of the results; by default f8 or, of complex numbers, times and texts, their own.
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
    dry_run : bool
        Whether to print only what would be computed and reused, and the estimated time.

    Returns
    -------
    Dataset
        In memory, with a dimension for each argument. A number or array is one variable, named
        after the function; a mapping, a data set or data array (with its dimensions, coordinates
        and attributes) and a tuple with `outputs` are several. Missing where calls failed. Empty
        after a dry run, whose numbers are its attributes.

    Raises
    ------
    ConfigurationError
        If a value, an argument or the store cannot be used, or the function holds what has no
        content to compare, such as an open file. Nothing was called.
    DeclarationError
        If results do not fit together, such as a text for one value and a number for another.

    Warns
    -----
    CallsFailed
        If some calls failed, with their arguments and the first traceback. All others are in the
        store, and these are tried again next time.

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
    experiment, joint = _declare(function, values, outputs, dims, attrs or {}, dtype, version)
    if cluster not in CLUSTER_KINDS:
        raise ConfigurationError(f"cluster is {cluster!r}, but must be 'inline' or 'local'")
    if not isinstance(store, str | os.PathLike):
        raise ConfigurationError(f"store is {store!r}, but must be a path or a URL")
    choices = read_choices(experiment.declared, {Run.seed.key: seed, Cluster.kind.key: cluster})
    choices = replace(choices, joint=joint)
    at = path_or_url("store", store)
    packs = path_or_url("cache", cache) if cache else user_cache_path("sweeps")
    options = RunOptions(at, packs, ClusterChoice(cluster))
    import xarray as xr  # slow to import

    check_targets([at], packs)
    if dry_run:
        stages, estimate = preview(Plan(experiment, choices), options)
        cells, left = stages[experiment.name]
        show(f"{experiment.name}: {left:,} to compute, {cells - left:,} reused; {estimate}")
        return xr.Dataset(attrs={"left": left, "reused": cells - left, "estimate": estimate})
    failed: list[Failure] = []
    try:
        with progress_bar() as step:
            watch = Watch(lambda sentence: None, step, failed.append)
            finished = run(Plan(experiment, choices), options, watch)
    except ConfigurationError as error:
        raise ConfigurationError(str(error)) from None  # from this line on, and not from within
    if failed:
        warnings.warn(_failure_message(finished, failed), CallsFailed, stacklevel=2)
    found = xr.open_zarr(zarr_store(at), group=experiment.title, chunks=None)
    found = with_scalars(found.load())
    for name, one in found.variables.items():
        if PADDING in one.attrs:
            say("sweeps", f"{name} is padded {one.attrs[PADDING]}")
    return found


def _declare(
    function: Callable[..., Any],
    values: Any,
    outputs: Names,
    dims: Names | Mapping[str, Names],
    attrs: Mapping[str, Mapping[str, Any]],
    dtype: str,
    version: str,
) -> tuple[Experiment, tuple[Joint, ...]]:
    """Return the experiment of a function, and the arguments that run together.

    Raises ConfigurationError if the function cannot be swept over these values.
    """
    if not callable(function):
        raise ConfigurationError(f"function is {function!r}, but must be a callable")
    module, qualified = module_and_name(function)
    name = qualified.rpartition(".")[2]
    name = name if name.isidentifier() else "result"
    for one, about in attrs.items():
        if not isinstance(about, Mapping):
            example = f"{{{one!r}: {{'units': 'm'}}}}"
            raise ConfigurationError(f"attrs[{one!r}] is {about!r}, but must be as in {example}")
    settings, joint = read_values(name, values, attrs)
    reads = _arguments(name, function, values, settings)
    read = {setting.key for setting in reads.values()}
    if unused := [axis.name for axis in joint if read.isdisjoint(axis.keys)]:
        what = f"values has the dimension {unused[0]!r}, along which {name} has no argument"
        raise ConfigurationError(what)
    taken = frozenset([one.name for one in settings] + [one.name for one in joint])
    result = _declare_result(name, outputs, dims, dtype, taken, attrs)
    group = Group("results" if name == STATUS else name)  # `STATUS` has states of cells
    stage = Stage(name, function, (result,), reads=reads, group=group, version=version)
    lacking = [argument for argument in stage.arguments if argument not in (*reads, RNG)]
    if lacking:
        raise ConfigurationError(f"values lacks {lacking[0]!r}, which {name} takes")
    try:
        packages = (module.partition(".")[0],)
        return Experiment(name, group.path, (*settings, stage), code=packages), joint
    except DeclarationError as error:
        raise ConfigurationError(str(error)) from None


def _arguments(
    name: str, function: Callable[..., Any], values: Any, settings: Iterable[Argument]
) -> dict[str, Any]:
    """Return the settings that are arguments of a function, by their names.

    Others are labels of a data set's dimensions.
    """
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:
        what = f"function is {name}, whose arguments Python cannot inspect"
        raise ConfigurationError(f"{what}; call it in a function of your own") from None
    by_kind = {one.name: one.kind for one in parameters}
    needed = {one.name for one in parameters if one.default is one.empty}
    for one, kind in by_kind.items():
        if kind is inspect.Parameter.POSITIONAL_ONLY and (one in values or one in needed):
            remedy = f"lambda {one}: {name}({one})"
            raise ConfigurationError(
                f"{name} takes {one!r} by position only, but must take it by name, as in {remedy}"
            )
    takes_any = inspect.Parameter.VAR_KEYWORD in by_kind.values()
    several = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    known = [one for one, kind in by_kind.items() if kind not in several]
    labels = getattr(values, "coords", ())
    for one in values:
        if one not in known and one not in labels and not takes_any:
            raise ConfigurationError(f"values has {one!r}, but {name} takes {', '.join(known)}")
        if one in (RNG, VALID):
            raise ConfigurationError(f"values has {one!r}, a name that has a meaning of its own")
    return {one.name: one for one in settings if one.name in known or one.name not in labels}


def _declare_result(
    name: str,
    outputs: Names,
    dims: Names | Mapping[str, Names],
    dtype: str,
    reserved: frozenset[str],
    attrs: Mapping[str, Mapping[str, Any]],
) -> Undeclared:
    """Return the undeclared output of a function."""
    names = _as_names("outputs", outputs)
    if isinstance(dims, Mapping):
        of = {one: _as_names(f"dims[{one!r}]", given) for one, given in dims.items()}
        every: tuple[str, ...] = ()
    else:
        every = _as_names("dims", dims)
        of = {one: every for one in (names or (name,))[:1] if every and len(names) < 2}
    for key, found in (("outputs", names), *(("dims", one) for one in (every, *of.values()))):
        for one in found:
            own = (*names, *of, *([] if names or of else [name])) if key == "dims" else ()
            if found.count(one) > 1 or one in own or one in reserved:
                what = "an argument" if one in reserved else "a result"
                what = "two of them" if found.count(one) > 1 else what
                raise ConfigurationError(f"{key} has {one!r}, the name of {what}; rename one")
    how: dict[str, Any] = {"names": names, "dims_of": of, "reserved": reserved, "about": attrs}
    return Undeclared(name, every, dtype or FLOAT, label=name, infer_dtype=not dtype, **how)


def _as_names(key: str, given: Any) -> tuple[str, ...]:
    """Return names as a tuple; a text is one name."""
    names = (given,) if isinstance(given, str) else given
    if not isinstance(names, tuple | list) or not all(isinstance(one, str) for one in names):
        raise ConfigurationError(f"{key} is {given!r}, but must be a name or a tuple of names")
    return tuple(names)


def _failure_message(finished: Finished, failed: Sequence[Failure]) -> str:
    """Return the message on failed calls: their number, the first ones, and a traceback."""
    calls = sum(one.total for one in finished.progress.values())
    named = [f"  {one.name}: {one.reason}" for one in failed[:NAMED_FAILURES]]
    more = len(failed) - NAMED_FAILURES
    first = failed[0]
    given = f", with {', '.join(first.arguments.splitlines())}" if first.arguments else ""
    return "\n".join(
        [
            f"{len(failed):,} of {calls:,} calls failed; the same sweep tries them again",
            *named,
            *([f"  and {more:,} more"] if more > 0 else []),
            f"The first of them{given}:",
            first.traceback or first.reason,
        ]
    )
