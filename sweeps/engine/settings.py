"""Settings, by the name that scripts of earlier versions import; now in `sweeps`."""

from sweeps.engine.declare.settings import *  # noqa: F403
