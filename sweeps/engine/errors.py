"""Errors of a sweep, by exit status."""


class ConfigurationError(ValueError):
    """The configuration is invalid: one sentence with key, value and what is allowed (exit 2)."""


class DeclarationError(TypeError):
    """Inconsistent declarations of an experiment: a mistake of its author."""


class CallsFailed(UserWarning):
    """Some calls of a function failed; the message names them, and has the first traceback."""


class SweepIncomplete(RuntimeError):
    """Some cells failed; the message names them (exit 1)."""
