"""Helpers that read the README and the pages of the documentation, and their code blocks."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MADE = ("_build", "api", "tutorials")  # by a build of the site
DOCS = sorted(
    page
    for page in (ROOT / "docs").rglob("*.md")
    if page.relative_to(ROOT / "docs").parts[0] not in MADE
)
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS]


def text_of(page):
    return page.read_text(encoding="utf-8")


def prose_of(page):
    """Return the text of a page without its code blocks."""
    return re.sub(r"^```.*?^```", "", text_of(page), flags=re.S | re.M)


def fences(page, *languages):
    """Return language and content of the code blocks in some languages, in order."""
    found = re.findall(r"^```(\w*)\n(.*?)^```", text_of(page), re.S | re.M)
    return [(language, block) for language, block in found if language in languages]


def blocks(page, language):
    return [block for _, block in fences(page, language)]


def commands(block, name):
    """Return lines of a block that call a command, without their comments."""
    whole = block.replace("\\\n", " ")
    lines = (line.split(" #")[0].strip() for line in whole.splitlines())
    return [line for line in lines if line.startswith(f"{name} ")]
