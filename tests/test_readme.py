"""What the README shows, done."""

import re
import shlex
import sys

import matplotlib as mpl
import pytest
from commands import prepared
from documentation import PAGES, ROOT, blocks, commands

from sweeps.report.command import main

README = ROOT / "README.md"


def test_the_lines_that_open_a_store_draw_four_views_of_its_ships(
    smoke_store, tmp_path, monkeypatch
):
    mpl.use("Agg")
    (tmp_path / "sweep.zarr").symlink_to(smoke_store, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    (code,) = blocks(README, "python")
    namespace = {}
    exec(compile(code, "README.md", "exec"), namespace)
    from matplotlib import pyplot as plt

    panels = plt.gcf().axes
    assert [len(panel.lines) for panel in panels] == [2] * 4
    label = " ".join(panels[0].get_xlabel().split())
    assert label == "down-range from the ship origin [m]"
    plt.close("all")


def test_the_scores_shown_are_those_of_the_sweep(smoke_store, tmp_path, monkeypatch, capsys):
    (tmp_path / "sweep.zarr").symlink_to(smoke_store, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["ncti-report", "sweep.zarr"])
    main()
    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    (shown,) = [text for text in blocks(README, "") if text.startswith("classifier ")]
    scores = [line.split() for line in shown.splitlines() if "[" in line]
    assert len(scores) == 2
    assert all(line in printed for line in scores)


def test_the_call_of_a_single_signature_draws_it():
    mpl.use("Agg")
    (code,) = blocks(README, "py")
    exec(compile(code, "README.md", "exec"), {})
    from matplotlib import pyplot as plt

    (line,) = plt.gca().lines
    assert line.get_ydata().max() > 0
    plt.close("all")


def test_it_is_one_page():
    assert len(README.read_text(encoding="utf-8").split()) <= 700


COMMANDS = [
    line
    for block in blocks(README, "sh")
    for line in commands(block, "ncti-sweep")
    if "--" not in line
]


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_is_a_configuration_that_would_run(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(COMMANDS) >= 2
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
