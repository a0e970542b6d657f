"""Stages, by the name that scripts of earlier versions import; now in `sweeps`."""

from sweeps.engine.declare.stage import *  # noqa: F403
