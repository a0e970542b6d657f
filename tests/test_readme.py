"""The README shows the sweep's answer and is one page, and links of the pages lead somewhere."""

import re
import sys

import pytest
from documentation import PAGES, ROOT, blocks, prose_of, text_of

from sweeps.report.command import main

README = ROOT / "README.md"


def test_readme_answer_matches_the_sweep(smoke_store, tmp_path, monkeypatch, capsys):
    (tmp_path / "sweep.zarr").symlink_to(smoke_store, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["ncti-report", "sweep.zarr"])
    main()
    printed = " ".join(capsys.readouterr().out.split())
    (shown,) = [text for text in blocks(README, "") if text.startswith("Best of")]
    assert "chance" in shown and " ".join(shown.split()) in printed


def test_readme_fits_on_one_page():
    assert len(text_of(README).split()) <= 700


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_linked_file_and_section_exists(page):
    for link in re.findall(r"\]\(([^)h][^)]*)\)", prose_of(page)):
        name, _, section = link.partition("#")
        found = (page.parent / name).resolve() if name else page
        assert found.exists(), link
        if section:
            titles = re.findall(r"^#+ (.*)$", text_of(found), re.M)
            assert section in [anchor(title) for title in titles], link


def anchor(title):
    """Return the name of a section in a link."""
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")
