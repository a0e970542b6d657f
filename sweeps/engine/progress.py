"""How far a stage is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Progress:
    """Cells of a stage: all there are, found at hand, made, failed, and the time that took."""

    total: int = 0
    reused: int = 0
    done: int = 0
    failed: int = 0
    seconds: float = 0.0

    def begin(self, total: int, missing: int) -> None:
        """Take down how many cells there are, and are missing; again when some were damaged."""
        self.total = max(total, self.total)
        self.reused = max(self.total - missing - self.done - self.failed, 0)
        self.done = self.total - missing - self.reused - self.failed
