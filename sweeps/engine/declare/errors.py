"""Errors of a sweep, by exit status."""

import inspect
import os
from collections.abc import Callable
from typing import Any


class ConfigurationError(ValueError):
    """The configuration is invalid: one sentence with key, value and what is allowed (exit 2)."""


class DeclarationError(TypeError):
    """Inconsistent declarations of an experiment: a mistake of its author."""


class CallsFailed(UserWarning):
    """Some calls of a function failed; the message names them, and has the first traceback."""


class SweepIncomplete(RuntimeError):
    """Some cells failed; the message names them (exit 1)."""


def with_location(thing: type | Callable[..., Any], sentence: str) -> str:
    """Return a sentence on a class or function after its file and line, where it has these."""
    try:
        file, line = inspect.getfile(thing), inspect.getsourcelines(thing)[1]
    except (OSError, TypeError):
        return sentence
    return f"{os.path.relpath(file)}:{line}: {sentence}"
