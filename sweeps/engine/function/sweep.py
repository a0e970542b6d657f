"""Sweep of one function over a grid of values, without declarations."""

from __future__ import annotations

import inspect
import os
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from platformdirs import user_cache_path

from sweeps.engine.declare.errors import CallsFailedWarning, ConfigurationError, DeclarationError
from sweeps.engine.declare.failures import Failure
from sweeps.engine.declare.paths import path_or_url
from sweeps.engine.declare.settings import Cluster, Run, ZippedAxis, read_choices
from sweeps.engine.declare.stage import RNG, STATUS, VALID, Experiment, Group, Stage
from sweeps.engine.declare.undeclared import FLOAT, PADDING, UndeclaredOutput
from sweeps.engine.function.arguments import Argument, read_values
from sweeps.engine.resolve.code import module_and_name
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.process import say, show
from sweeps.engine.run.progress import NAMED_FAILURES, progress_bar
from sweeps.engine.run.schedule import Callbacks
from sweeps.engine.store.tables import restore_scalars
from sweeps.engine.store.targets import check_targets
from sweeps.engine.store.writing import zarr_store
from sweeps.engine.sweeping import RunOptions, SweepOutcome, preview
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

    Earlier results, of this or another process, are reused: an interrupted sweep resumes, and a
    sweep with more values extends its store. It runs from a script, a notebook or a prompt, and
    shows its progress in a terminal or notebook.

    Parameters
    ----------
    function : callable
        Its arguments are the names in `values`, others with a default, and `rng`, a generator of
        random numbers, independent for each combination. Lambdas, methods, `functools.partial`,
        decorated functions and functions of a notebook also work.
    values : mapping of str to iterable, or Dataset
        Values of each argument: numbers, whole numbers, texts, truth values or times (`datetime`,
        or numpy's). Variables of a data set that share a dimension run together, different
        dimensions are combined, and scalars are fixed; the result has its coordinates.
    store : path
        Folder of the store, in zarr's format, or URL of a bucket such as 's3://bucket/x.zarr'.
    outputs : tuple of str
        Names of the elements of a tuple that the function returns.
    dims : tuple of str, or mapping of str to tuple of str
        Names of the dimensions of arrays that the function returns, or of each array by its name.
        Arrays of different length are padded with NaN.
    attrs : mapping of str to mapping
        Attributes, such as units, of results and arguments by name.
    dtype : str
        Dtype of the results; by default f8, or the dtype of complex numbers, times and texts.
    seed : int
        Seed of all random numbers.
    cluster : str
        `inline` for this process, or `local` for a process on every core; a script that uses
        `local` begins its work under ``if __name__ == "__main__":``.
    cache : path, optional
        Folder or URL of finished results; by default the user's cache folder. A growing store takes
        earlier results from it.
    version : str
        Replaces the function's code in the keys of results: change it when results change.
    dry_run : bool
        Whether to only print the numbers of results to compute and reuse, and the estimated time.

    Returns
    -------
    Dataset
        In memory, with a dimension for each argument. A number or array is one variable, named
        after the function; a mapping, a data set or data array (with its dimensions, coordinates
        and attributes) and a tuple with `outputs` are several. Results of failed calls are missing.
        After a dry run, the data set is empty and has the numbers as attributes.

    Raises
    ------
    ConfigurationError
        If a value, an argument or the store cannot be used, or the function holds an object without
        content to compare, such as an open file. Nothing was called.
    DeclarationError
        If results are inconsistent, such as a text for one value and a number for another.

    Warns
    -----
    CallsFailedWarning
        If some calls failed, with their arguments and the first traceback. All other results are in
        the store; the next sweep tries failed calls again.

    Notes
    -----
    A result is reused while its dependencies, taken when the sweep begins, are the same: the
    values; the function's code, defaults and closure; each global that it names, functions and
    classes of its file in the same way, other values by content; the code of the modules of its
    package, and of modules that are not installed; and the versions of installed packages.

    Files that the function reads, the clock, environment variables, answers of `input` or a server,
    and side effects of imports are not detected. Pass their content, or its hash, as an argument or
    a global, or change `version`. A global that the function itself changes, such as a list that it
    appends to, differs in the next sweep, which computes everything again.
    """
    experiment, zipped = _declare_experiment(
        function, values, outputs, dims, attrs or {}, dtype, version
    )
    if cluster not in CLUSTER_KINDS:
        raise ConfigurationError(f"cluster is {cluster!r}, but must be 'inline' or 'local'")
    if not isinstance(store, str | os.PathLike):
        raise ConfigurationError(f"store is {store!r}, but must be a path or a URL")
    choices = read_choices(experiment.declared, {Run.seed.key: seed, Cluster.kind.key: cluster})
    choices = replace(choices, zipped=zipped)
    target = path_or_url("store", store)
    packs = path_or_url("cache", cache) if cache else user_cache_path("sweeps")
    options = RunOptions(target, packs, ClusterChoice(cluster))
    import xarray as xr

    check_targets([target], packs)
    if dry_run:
        stages, estimate = preview(Plan(experiment, choices), options)
        cells, missing = stages[experiment.name]
        show(f"{experiment.name}: {missing:,} to compute, {cells - missing:,} reused; {estimate}")
        return xr.Dataset(attrs={"left": missing, "reused": cells - missing, "estimate": estimate})
    failures: list[Failure] = []  # the first of them, since each has a traceback

    def record_failure(failure: Failure) -> None:
        if len(failures) < NAMED_FAILURES:
            failures.append(failure)

    try:
        with progress_bar() as step:
            callbacks = Callbacks(lambda sentence: None, step, record_failure)
            finished = run(Plan(experiment, choices), options, callbacks)
    except ConfigurationError as error:
        raise ConfigurationError(str(error)) from None  # without the traceback of the engine
    if failures:
        warnings.warn(_failure_message(finished, failures), CallsFailedWarning, stacklevel=2)
    results = xr.open_zarr(zarr_store(target), group=experiment.title, chunks=None)
    results = restore_scalars(results.load())
    for name, variable in results.variables.items():
        if PADDING in variable.attrs:
            say("sweeps", f"{name} is padded {variable.attrs[PADDING]}")
    for name in attrs or {}:
        if name not in results.variables:
            say("sweeps", f"attrs has {name!r}, which is neither a result nor an argument")
    return results


def _declare_experiment(
    function: Callable[..., Any],
    values: Any,
    outputs: Names,
    dims: Names | Mapping[str, Names],
    attrs: Mapping[str, Mapping[str, Any]],
    dtype: str,
    version: str,
) -> tuple[Experiment, tuple[ZippedAxis, ...]]:
    """Return the experiment of a function, and the zipped axes of arguments that run together.

    Raises ConfigurationError if the function cannot be swept over these values.
    """
    if not callable(function):
        raise ConfigurationError(f"function is {function!r}, but must be a callable")
    module, qualified = module_and_name(function)
    name = qualified.rpartition(".")[2]
    name = name if name.isidentifier() else "result"
    for variable, attributes in attrs.items():
        if not isinstance(attributes, Mapping):
            example = f"{{{variable!r}: {{'units': 'm'}}}}"
            raise ConfigurationError(
                f"attrs[{variable!r}] is {attributes!r}, but must be as in {example}"
            )
    settings, zipped = read_values(name, values, attrs)
    reads = _argument_settings(name, function, values, settings)
    read_keys = {setting.key for setting in reads.values()}
    if unused := [axis.name for axis in zipped if read_keys.isdisjoint(axis.keys)]:
        message = f"values has the dimension {unused[0]!r}, along which {name} has no argument"
        raise ConfigurationError(message)
    reserved = (*(setting.name for setting in settings), *(axis.name for axis in zipped))
    result = _declare_result(name, outputs, dims, dtype, reserved, attrs)
    group = Group("results" if name == STATUS else name)  # `STATUS` has states of cells
    stage = Stage(name, function, (result,), reads=reads, group=group, version=version)
    lacking = [argument for argument in stage.arguments if argument not in (*reads, RNG)]
    if lacking:
        raise ConfigurationError(f"values lacks {lacking[0]!r}, which {name} takes")
    try:
        packages = (module.partition(".")[0],)
        return Experiment(name, group.path, (*settings, stage), code=packages), zipped
    except DeclarationError as error:
        raise ConfigurationError(str(error)) from None


def _argument_settings(
    name: str, function: Callable[..., Any], values: Any, settings: Iterable[Argument]
) -> dict[str, Any]:
    """Return the settings that are arguments of a function, by their names.

    Other settings are labels of a data set's dimensions.
    """
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:
        problem = f"function is {name}, whose arguments Python cannot inspect"
        raise ConfigurationError(f"{problem}; wrap it in a function") from None
    kind_by_name = {parameter.name: parameter.kind for parameter in parameters}
    required = {parameter.name for parameter in parameters if parameter.default is parameter.empty}
    for argument, kind in kind_by_name.items():
        if kind is inspect.Parameter.POSITIONAL_ONLY and (
            argument in values or argument in required
        ):
            remedy = f"lambda {argument}: {name}({argument})"
            raise ConfigurationError(
                f"{name} takes {argument!r} by position only, but must take it by name, as in "
                f"{remedy}"
            )
    takes_any = inspect.Parameter.VAR_KEYWORD in kind_by_name.values()
    several = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    named = [argument for argument, kind in kind_by_name.items() if kind not in several]
    labels = getattr(values, "coords", ())
    for argument in values:
        if argument not in named and argument not in labels and not takes_any:
            raise ConfigurationError(
                f"values has {argument!r}, but {name} takes {', '.join(named) or 'no name'}"
            )
        if argument in (RNG, VALID):
            raise ConfigurationError(f"values has {argument!r}, a reserved name")
    return {
        setting.name: setting
        for setting in settings
        if setting.name in named or setting.name not in labels
    }


def _declare_result(
    name: str,
    outputs: Names,
    dims: Names | Mapping[str, Names],
    dtype: str,
    reserved: tuple[str, ...],
    attrs: Mapping[str, Mapping[str, Any]],
) -> UndeclaredOutput:
    """Return the undeclared output of a function."""
    names = _as_names("outputs", outputs)
    if isinstance(dims, Mapping):
        shared_dims: tuple[str, ...] = ()
        dims_of = {
            variable: _as_names(f"dims[{variable!r}]", value) for variable, value in dims.items()
        }
    else:
        shared_dims = _as_names("dims", dims)
        is_single = shared_dims and len(names) < 2
        dims_of = {(names or (name,))[0]: shared_dims} if is_single else {}
    results = {*names, *dims_of} or {name}
    _check_names("outputs", names, (), reserved)
    for dim_names in (shared_dims, *dims_of.values()):
        _check_names("dims", dim_names, results, reserved)
    return UndeclaredOutput(
        name,
        shared_dims,
        dtype or FLOAT,
        label=name,
        infer_dtype=not dtype,
        names=names,
        dims_of=dims_of,
        reserved=reserved,
        extra_attributes=attrs,
    )


def _check_names(
    key: str, names: Sequence[str], results: Collection[str], arguments: Collection[str]
) -> None:
    """Refuse names that are repeated, or are those of results or arguments."""
    for name in names:
        if names.count(name) > 1 or name in results or name in arguments:
            owner = "an argument" if name in arguments else "a result"
            owner = "two of them" if names.count(name) > 1 else owner
            raise ConfigurationError(f"{key} has {name!r}, the name of {owner}; rename one")


def _as_names(key: str, value: Any) -> tuple[str, ...]:
    """Return names as a tuple; a text is one name."""
    names = (value,) if isinstance(value, str) else value
    if not isinstance(names, tuple | list) or not all(isinstance(name, str) for name in names):
        raise ConfigurationError(f"{key} is {value!r}, but must be a name or a tuple of names")
    return tuple(names)


def _failure_message(finished: SweepOutcome, failures: Sequence[Failure]) -> str:
    """Return the message on failed calls: their number, the first of them, and a traceback."""
    calls = sum(progress.total for progress in finished.progress.values())
    lines = [f"  {failure.name}: {failure.reason}" for failure in failures]
    number = len(finished.failures)
    more = number - len(failures)
    first = failures[0]
    arguments = f", with {', '.join(first.arguments.splitlines())}" if first.arguments else ""
    return "\n".join(
        [
            f"{number:,} of {calls:,} calls failed; the same sweep tries them again",
            *lines,
            *([f"  and {more:,} more"] if more > 0 else []),
            f"The first of them{arguments}:",
            first.traceback or first.reason,
        ]
    )
