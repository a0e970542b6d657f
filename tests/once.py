"""Helpers that share folders among all processes of a test run, and ships among all runs."""

import os
from collections.abc import Callable
from fcntl import LOCK_EX, flock
from pathlib import Path
from typing import Any

from platformdirs import user_cache_path


def made_once(factory: Any, name: str, make: Callable[[Path], object]) -> Path:
    """Return the folder of a name that one of the processes fills; the others wait for it."""
    root = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent  # the folder of all workers
    folder: Path = root / f"once-{name}"
    folder.mkdir(exist_ok=True)
    with (folder / ".lock").open("w") as lock:
        flock(lock, LOCK_EX)
        if not (folder / ".done").exists():
            make(folder)
            (folder / ".done").touch()
    return folder


def sharing_ships(cache: Path) -> Path:
    """Return a cache of results, made if it is not there, that shares ships with all tests."""
    ships = user_cache_path("ncti-sweep") / "meshes"
    for folder in (ships, cache):
        folder.mkdir(parents=True, exist_ok=True)
    if cache != ships.parent and not (cache / "meshes").exists():
        (cache / "meshes").symlink_to(ships, target_is_directory=True)
    return cache
