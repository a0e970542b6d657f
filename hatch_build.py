"""Put the top-level `conf/` folder inside the wheel.

An editable install reads `conf/` at the repository root, so only a standard wheel gets the copy.
"""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class ConfInWheel(BuildHookInterface):
    """Ship `conf/` as `sweeps/conf/`."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the folder to a standard wheel, and leave an editable one alone."""
        if version == "standard":
            build_data["force_include"]["conf"] = "sweeps/conf"
