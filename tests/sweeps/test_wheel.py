"""The wheel holds all data files, and the command runs from it, in any folder."""

import zipfile
from pathlib import Path

import pytest
from running import ROOT, python

COMMAND = """
import sys
from sweeps.experiment import conf_folder
from sweeps.app import main
print(conf_folder())
main(sys.argv[1:])
"""


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    python("-m", "hatchling", "build", "-t", "wheel", "-d", folder)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def below(folder, *patterns):
    return {path.relative_to(folder) for pattern in patterns for path in folder.rglob(pattern)}


def test_wheel_contains_exactly_the_user_code_and_data(unpacked):
    """Code of developers, such as the benchmarks, is not."""
    packages = {path.name for path in unpacked.iterdir() if path.suffix != ".dist-info"}
    assert packages == {"ncti", "studies", "sweeps"}
    conf = below(unpacked / "sweeps" / "conf", "*.yaml")
    assert conf == below(ROOT / "conf", "*.yaml")
    for package in packages:
        kinds = ("*.py", "*.yaml", "*.vert", "*.frag", "*.glsl", "*.html", "*.css", "*.js", "*.md")
        files = below(unpacked / package, *kinds) - {Path("conf") / path for path in conf}
        assert files == below(ROOT / package, *kinds)


def test_the_command_plans_a_sweep_from_the_wheel(unpacked, folder, cache):
    """A whole sweep would compile all loops anew, as machine code is kept by path."""
    arguments = ("+experiment=smoke", "dry_run=true", "store=s.zarr", f"cache={cache}")
    process = python("-c", COMMAND, *arguments, cwd=folder, PYTHONPATH=str(unpacked))
    conf, *printed = process.stdout.splitlines()
    assert conf == str(unpacked / "sweeps" / "conf")
    assert any("averaged" in line for line in printed)
