"""Table of all settings, made from their declarations; as a script, it is written."""

import csv
import io
import re
from pathlib import Path

from sweeps.engine.declare.kinds import format_value
from sweeps.experiment import EXPERIMENT

TABLE = Path(__file__).resolve().parents[1] / "tables" / "settings.csv"
ABBREVIATIONS = (
    (r"a (?:finite )?number (?=from|at least)", ""),
    (r"a whole number from (\S+) to (\S+)", r"\1 to \2, whole"),
    (r"\bfrom (\S+) to ", r"\1 to "),
    (r"a text that is not empty", "text"),
    (r"(?<!each )one of ", ""),
)
"""Patterns in error messages, and their short forms in the column of allowed values."""


def table() -> str:
    """Return the table as CSV: key, default, allowed values with their unit, axis, and meaning.

    Keys of a mapping that may be a value of a setting follow that setting.
    """
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n").writerow
    write(("key", "default", "allowed", "axis", "meaning"))
    for entry in (
        entry for setting in EXPERIMENT.declared for entry in (setting, *setting.kind.entries)
    ):
        allowed = entry.kind.allowed
        for words, shorter in ABBREVIATIONS:
            allowed = re.sub(words, shorter, allowed)
        axis = f"no; {entry.not_swept}" if entry.not_swept else "yes"
        meaning = "; ".join(filter(None, (entry.label, entry.help)))
        write((entry.key, format_value(entry.default_input), allowed, axis, meaning))
    return text.getvalue()


if __name__ == "__main__":
    TABLE.write_text(table(), encoding="utf-8")
