"""The page of all settings, made of their declarations; as a script, it is written."""

from pathlib import Path

from sweeps.engine.declare.kinds import format_value
from sweeps.experiment import EXPERIMENT

PAGE = Path(__file__).resolve().parents[1] / "settings.md"


def page() -> str:
    """Return the page: a table of key, default, allowed values with their unit, and meaning.

    Keys of a mapping that may be a value of a setting follow that setting.
    """
    rows = [("key", "default", "allowed", "meaning"), ("---",) * 4]
    for one in (entry for setting in EXPERIMENT.declared for entry in (setting, *setting.entries)):
        about = "; ".join(filter(None, (one.label, one.help)))
        axis = f"one value: {one.fixed}" if one.fixed else ""
        null = "null or " if one.fallback is not None else ""
        allowed = "; ".join(filter(None, (f"{null}{one.kind.allowed}", axis)))
        rows.append((f"`{one.key}`", format_value(one.default_input), allowed, about))
    lines = (f"| {' | '.join(row)} |" for row in rows)
    return "\n".join(("# Settings", "", *lines, ""))


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
