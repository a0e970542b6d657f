"""The two ways a sweep ends badly."""


class ConfigurationError(ValueError):
    """The configuration is wrong: one sentence with key, value and what is allowed (exit 2)."""


class SweepIncomplete(RuntimeError):
    """Some cells failed; the message names them (exit 1)."""
