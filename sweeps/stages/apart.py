"""Calls in a separate process, for engines that cannot render in this one.

OpenGL is bound to one platform a process. A sweep over engines needs two of them.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

from ncti.render import EngineError
from ncti.render.choice import choose_engine, engines

Result = TypeVar("Result")


def call_apart(
    engine: str, function: Callable[..., Result], *arguments: Any, **named: Any
) -> Result:
    """Return the result of a function, called in a process where an engine can render.

    That is this process, unless the engine needs another OpenGL than the one bound, or preferred,
    here. Function, arguments and result are pickled then.

    Parameters
    ----------
    engine : str
        Name of an engine, or `lines`.
    function : callable
        Of a module.
    *arguments, **named
        Its arguments.

    Raises
    ------
    EngineError
        If the other process ends without a result; else whatever the function raises.
    """
    call = partial(function, *arguments, **named)
    if engine not in engines() or engine in ("embree", choose_engine("auto")):
        return call()
    # Not `multiprocessing`: workers of dask may not have children of that kind.
    code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import serve; serve()"
    done = subprocess.run(
        [sys.executable, "-c", code], input=pickle.dumps(call), stdout=subprocess.PIPE
    )
    if done.returncode:
        raise EngineError(f"the process that draws with {engine} has ended")
    result, error = pickle.loads(done.stdout)
    if error is not None:
        raise error
    return result


def serve() -> None:
    """Answer the call on stdin with its result, or its error, on stdout."""
    out, sys.stdout = sys.stdout.buffer, sys.stderr  # what libraries print is no answer
    call = pickle.load(sys.stdin.buffer)
    try:
        answer: tuple[Any, Exception | None] = call(), None
    except Exception as error:
        answer = None, error
    pickle.dump(answer, out)
