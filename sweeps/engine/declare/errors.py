"""Errors of a sweep, by exit status."""

import inspect
import os
from collections.abc import Callable
from typing import Any


class ConfigurationError(ValueError):
    """Invalid configuration: one sentence with key, value and the allowed values (exit 2)."""


class DeclarationError(TypeError):
    """Inconsistent declarations of an experiment: a mistake of its author."""


class CallsFailedWarning(UserWarning):
    """Some calls of a function failed; the message names them, and has the first traceback."""


class SweepIncompleteError(RuntimeError):
    """Some cells failed; the message names them (exit 1)."""


def locate(thing: type | Callable[..., Any], sentence: str) -> str:
    """Prefix a sentence with the file and line of a class or function, if it has these."""
    try:
        file, line = inspect.getfile(thing), inspect.getsourcelines(thing)[1]
    except (OSError, TypeError):
        return sentence
    return f"{os.path.relpath(file)}:{line}: {sentence}"
