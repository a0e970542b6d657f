"""Imported by the fork server alone, and first, so that its other imports take less time."""

from sweeps.engine.run.collector import relax_gc

relax_gc()
