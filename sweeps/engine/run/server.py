"""Imported first by the fork server, so that its other imports take less time."""

from sweeps.engine.run.collector import relax_gc

relax_gc()
