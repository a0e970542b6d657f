"""Texts of users that are safe to print."""

from __future__ import annotations


def printable(text: str) -> str:
    """Return text with control and unprintable characters as backslash escapes."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
