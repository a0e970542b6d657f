"""Calls in a separate process, for engines that cannot render in this one.

OpenGL is bound to one platform a process. A sweep over engines needs two of them.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

from ncti.render import EngineError
from ncti.render.choice import choose_engine, engines

Result = TypeVar("Result")


def call_in_process(
    engine: str, function: Callable[..., Result], *arguments: Any, **named: Any
) -> Result:
    """Return the result of a function, called in a process where an engine can render.

    The call stays in this process unless the engine, a name or `lines`, needs an OpenGL platform
    other than the one bound, or preferred, here. Otherwise function, arguments and result are
    pickled, and `EngineError` reports that the other process has ended.
    """
    if engine not in engines() or engine in ("embree", choose_engine("auto")):
        return function(*arguments, **named)
    # Not `multiprocessing`: workers of dask may not have children of that kind.
    process = _process(os.getpid(), engine)
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        pickle.dump((function, arguments, named), process.stdin, pickle.HIGHEST_PROTOCOL)
        process.stdin.flush()
        result, error = pickle.load(process.stdout)
    except (OSError, EOFError) as ended:
        process.kill()
        process.wait()
        _process.cache_clear()
        raise EngineError(f"the process that draws with {engine} has ended") from ended
    if error is not None:
        raise error
    return result


@cache
def _process(parent: int, engine: str) -> subprocess.Popen[bytes]:
    """Return the process that renders with an engine, which ends when its parent does."""
    return subprocess.Popen(
        [sys.executable, "-c", f"from {__name__} import serve; serve()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        # The threads of numerical libraries are limited by the environment, which it inherits.
        start_new_session=True,  # an interrupt reaches only the parent, whose end ends this one
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )


def serve() -> None:
    """Read calls from stdin and write their results to stdout until stdin is closed."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # keep prints of libraries out of the answers
    while True:
        try:
            function, arguments, keywords = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            answer: tuple[Any, Exception | None] = function(*arguments, **keywords), None
        except Exception as error:
            answer = None, error
        pickle.dump(answer, answers, pickle.HIGHEST_PROTOCOL)
        answers.flush()
