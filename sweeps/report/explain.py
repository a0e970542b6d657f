"""The glossary of the words of tables, which `--explain` prints and pages link to."""

from __future__ import annotations

import difflib
import re
import sys
import textwrap
from contextlib import suppress
from functools import cache
from pathlib import Path

GLOSSARY = Path(__file__).with_name("glossary.md")
WIDTH, MAX_SIMILAR = 79, 4
_ENTRY = re.compile(r"^((?:[^\s`].*\n)+)((?:  .*\n)+)", re.MULTILINE)
_MARKUP = (
    (re.compile(r",? ?\[theory\]\([^)]*\)"), ""),
    (re.compile(r"\[([^]]*)\]\([^)]*\)"), r"\1"),
    (re.compile(r"[`*]"), ""),
)


@cache
def glossary() -> dict[tuple[str, ...], str]:
    """Return the meaning of each term by its names, the usual name first."""
    entries = _ENTRY.findall(GLOSSARY.read_text(encoding="utf-8"))
    return {tuple(names.splitlines()): _strip_markup(text) for names, text in entries}


def meaning(word: str) -> str:
    """Return the meaning of a word in any case; empty if the glossary lacks it."""
    return _entries_by_word().get(_fold_word(word), ("", ""))[1]


def print_meaning(command: str, word: str) -> int:
    """Print the meaning of a word, or all words without one; return the exit status of a command.

    For a word that the glossary lacks, print an error that suggests similar terms.
    """
    with suppress(BrokenPipeError):
        if not word:
            print("\n".join(", ".join(names) for names in glossary()), flush=True)
            return 0
        if entry := _entries_by_word().get(_fold_word(word)):
            print(entry[0])
            print(textwrap.fill(entry[1], WIDTH, initial_indent="  ", subsequent_indent="  "))
            return 0
        print(
            f"{command}: --explain has {word!r}, but must be a word of the glossary, "
            f"{_similar_terms(word)}",
            file=sys.stderr,
        )
        return 2
    return 1


def _similar_terms(word: str) -> str:
    """Return the terms with a similar spelling."""
    by_word = _entries_by_word()
    close = difflib.get_close_matches(_fold_word(word), by_word, MAX_SIMILAR)
    terms = dict.fromkeys(by_word[name][0] for name in close)
    return f"such as {', '.join(terms)}" if terms else "which --explain alone lists"


@cache
def _entries_by_word() -> dict[str, tuple[str, str]]:
    """Return the usual name and the meaning of each term, by any of its names."""
    return {
        _fold_word(name): (names[0], text) for names, text in glossary().items() for name in names
    }


def _fold_word(word: str) -> str:
    return re.sub(r"[\s_-]+", " ", word).strip().casefold()


def _strip_markup(text: str) -> str:
    """Return a text without markup, on one line."""
    text = " ".join(text.split())
    for pattern, replacement in _MARKUP:
        text = pattern.sub(replacement, text)
    return text
