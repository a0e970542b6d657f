"""The wheel: it holds all data files, and the command runs from it, in any folder."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import xarray as xr

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def tracked(folder, pattern):
    return {path.relative_to(ROOT / folder) for path in (ROOT / folder).rglob(pattern)}


def test_data_files_are_in_the_wheel(unpacked):
    assert {
        p.relative_to(unpacked / "sweeps" / "conf") for p in unpacked.rglob("conf/**/*.yaml")
    } == (tracked("conf", "*.yaml"))
    for pattern in ("*.yaml", "*.vert", "*.frag", "*.glsl"):
        assert {p.relative_to(unpacked / "ncti") for p in (unpacked / "ncti").rglob(pattern)} == (
            tracked("ncti", pattern)
        )
    assert {path.name for path in unpacked.iterdir() if path.suffix != ".dist-info"} == {
        "ncti",
        "sweeps",
    }


def test_the_command_runs_from_the_wheel(unpacked, tmp_path, cache):
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "sweeps.app",
            "grid.ship=duncan",
            "grid.aspect=[0,90]",
            "grid.frame_count=4",
            "store=s.zarr",
            f"cache={cache}",
            "cluster=inline",
        ],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(unpacked)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert xr.open_zarr(tmp_path / "s.zarr", group="range_profile").sizes["aspect"] == 2
    where = subprocess.run(
        [sys.executable, "-c", "import sweeps.app as a; print(a.conf_folder())"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(unpacked)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert where.stdout.strip() == str(unpacked / "sweeps" / "conf")
