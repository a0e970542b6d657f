"""Running the command line in this process or as its users do."""

import os
import subprocess
import sys
from pathlib import Path

# One small sweep of both sensors, with several values on every axis but the ladar's range.
TINY = [
    "sensor=both",
    "grid.ship=[duncan,spruance]",
    "grid.aspect=[0,45,90]",
    "grid.pulse_width=[30,50]",
    "grid.frame_count=[2,4]",
    "grid.vigilance=[0.9,0.95]",
    "infrared.range=[25,50]",
    "infrared.vigilance=[0.8,0.87]",
    "infrared.inner_radius=[0.5,0.6]",
    "infrared.phases=2",
    "infrared.orders=2",
    "render.pixel=0.5",
    "render.engine=embree",
]


def command(*overrides, folder: Path, cache: Path | None = None, timeout: float = 300):
    """`ncti-sweep` as its users run it, in a folder of its own."""
    arguments = [sys.executable, "-m", "sweeps.app", *overrides]
    if cache is not None:
        arguments.append(f"cache={cache}")
    return subprocess.run(
        arguments,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=timeout,
        env=os.environ | {"COLUMNS": "120"},
    )


def fresh(folder, cache):
    """A stage cache of its own that shares only the ships with the machine's."""
    (folder / "cache").mkdir()
    (folder / "cache" / "meshes").symlink_to(cache / "meshes", target_is_directory=True)
    (cache / "meshes").mkdir(parents=True, exist_ok=True)
    return folder / "cache"


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, by its relative path."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
