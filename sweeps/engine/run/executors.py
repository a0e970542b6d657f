"""Start of the chosen executor: this process, local processes, or a cluster."""

from __future__ import annotations

import sys
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from typing import Any

from sweeps.engine.cache.index import MARKER
from sweeps.engine.objects import Objects
from sweeps.engine.resolve.modules import ENGINE
from sweeps.engine.run.cluster import (
    JOB_QUEUES,
    SETTINGS_OF_KIND,
    ClusterChoice,
    Executor,
    InlineExecutor,
    import_jobqueue,
)
from sweeps.engine.run.forking import preloaded_modules, start_fork_server
from sweeps.engine.run.shared import Requirements, package_digest


def open_executor(
    choice: ClusterChoice,
    *,
    tasks: int = sys.maxsize,
    packages: Sequence[str] = (),
    modules: Sequence[str] = (),
    packs: Objects | None = None,
    say: Callable[[str], None],
) -> AbstractContextManager[Executor]:
    """Return a context that starts the chosen workers, or connects to them, and ends them.

    Parameters
    ----------
    choice : ClusterChoice
        Kind of cluster and its settings.
    tasks : int
        Upper bound of the number of tasks: no more workers than that are started.
    packages : sequence of str
        Packages, besides the engine, whose code must be the same on remote workers.
    modules : sequence of str
        Modules of the functions that tasks call: imported once for all local workers of this
        process, which do not see them change.
    packs : Objects, optional
        Cache of results, which remote workers must see.
    say : callable
        Called with messages for the user.

    Returns
    -------
    context manager of Executor
        Use it in one thread, which need not be the one that entered this context.

    Raises
    ------
    ConfigurationError
        If the cluster cannot be reached or started, or the code or folder of a worker differs.
    """
    if choice.kind in JOB_QUEUES:
        import_jobqueue(choice.kind)

    @contextmanager
    def start_executor() -> Iterator[Executor]:
        if choice.kind == "inline":
            yield InlineExecutor()
            return
        names = SETTINGS_OF_KIND[choice.kind]
        settings: dict[str, Any] = {name: getattr(choice, name) for name in names}
        with ExitStack() as stack:
            if choice.kind == "local":  # it imports while this process imports dask
                settings["method"] = start_fork_server(preloaded_modules(modules))
            from sweeps.engine.run import dask_cluster

            shared = Requirements()
            if choice.kind != "local":
                code = {name: package_digest(name) for name in (*ENGINE, *packages)}
                shared = Requirements(code, packs, f"{uuid.uuid4().hex}{MARKER}")
                if packs:
                    packs.put(shared.marker, b"")
                    stack.callback(packs.delete, [shared.marker])
            start = getattr(dask_cluster, choice.kind)
            yield stack.enter_context(start(**settings, tasks=tasks, shared=shared, say=say))

    return start_executor()
