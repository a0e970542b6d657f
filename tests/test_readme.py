"""What the README shows, done."""

import re
import shlex
from pathlib import Path

import matplotlib as mpl
import pytest

from sweeps.app import check_jobs, replace_axes
from sweeps.schema import register

README = (Path(__file__).resolve().parent.parent / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.S)


def test_the_lines_that_open_a_store_draw_four_curves(smoke_store, tmp_path, monkeypatch):
    mpl.use("Agg")
    (tmp_path / "sweep.zarr").symlink_to(smoke_store, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    (code,) = blocks("python")
    namespace = {}
    exec(compile(code, "README.md", "exec"), namespace)
    from matplotlib import pyplot as plt

    assert len(plt.gca().lines) == 4
    label = " ".join(plt.gca().get_xlabel().split())
    assert label == "down-range from the ship origin [m]"
    plt.close("all")


COMMANDS = [
    line.split("#")[0]
    for block in blocks("sh")
    for line in block.splitlines()
    if line.startswith("ncti-sweep") and "--" not in line
]


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_is_a_configuration_that_would_run(line, tmp_path, monkeypatch):
    register()
    monkeypatch.chdir(tmp_path)
    assert len(COMMANDS) >= 5
    check_jobs(replace_axes(shlex.split(line)[1:]))


def test_every_picture_and_page_is_there():
    root = Path(__file__).resolve().parent.parent
    links = re.findall(r"\]\(([^)h][^)]*)\)", README)
    assert len(links) >= 6
    for link in links:
        assert (root / link).exists(), link
