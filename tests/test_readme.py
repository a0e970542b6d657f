"""What the README shows, done."""

import re
import shlex

import matplotlib as mpl
import pytest
from commands import prepared
from documentation import PAGES, ROOT, blocks, commands

README = ROOT / "README.md"


def test_the_lines_that_open_a_store_draw_four_curves(smoke_store, tmp_path, monkeypatch):
    mpl.use("Agg")
    (tmp_path / "sweep.zarr").symlink_to(smoke_store, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    (code,) = blocks(README, "python")
    namespace = {}
    exec(compile(code, "README.md", "exec"), namespace)
    from matplotlib import pyplot as plt

    assert len(plt.gca().lines) == 4
    label = " ".join(plt.gca().get_xlabel().split())
    assert label == "down-range from the ship origin [m]"
    plt.close("all")


def test_the_lines_that_fly_past_a_ship_see_one():
    (code,) = blocks(README, "py")
    found = {}
    exec(compile(code, "README.md", "exec"), found)
    assert found["raw"].intensity.shape == found["scan"].intensity.shape
    assert found["raw"].attrs["slant_range"] == 3900
    assert (found["image"].intensity > 0).sum() > 300  # a stern 15 m wide, in pixels of 0.8 m


COMMANDS = [
    line
    for block in blocks(README, "sh")
    for line in commands(block, "ncti-sweep")
    if "--" not in line
]


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_is_a_configuration_that_would_run(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(COMMANDS) >= 5
    assert prepared(*shlex.split(line)[1:])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_picture_page_and_section_is_there(page):
    prose = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S)
    for link in re.findall(r"\]\(([^)h][^)]*)\)", prose):
        name, _, section = link.partition("#")
        found = (page.parent / name).resolve() if name else page
        assert found.exists(), link
        if section:
            titles = re.findall(r"^#+ (.*)$", found.read_text(encoding="utf-8"), re.M)
            assert section in [anchor(title) for title in titles], link


def anchor(title):
    """What a section is called in a link."""
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")
