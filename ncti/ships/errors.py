"""The one error of this room."""


class ShipError(ValueError):
    """A ship that cannot be loaded: one sentence naming the value and what is allowed."""
