"""Imports that workers of any sweep of ships need, made before the sweep is known.

Importing this module imports it; see `sweeps.engine.forking`.
"""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module

from sweeps.engine.forking import worth_importing
from sweeps.experiment import MODULES

for name in worth_importing(module.__name__ for module in MODULES):
    with suppress(ImportError):  # only saves time
        import_module(name)
