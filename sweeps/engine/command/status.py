"""Text of `--status`: the state of the latest sweep of a store."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import PathOrUrl
from sweeps.engine.run.progress import count_table, open_states, state_name, time_left
from sweeps.engine.run.schedule import Progress
from sweeps.engine.store.locks import LEASE, seconds_since_renewal

if TYPE_CHECKING:
    from rich.table import Table


def format_status(store: PathOrUrl, cache: PathOrUrl) -> tuple[str, Table]:
    """Return a sentence on the latest sweep of a store, and a table of its stages.

    Raises ConfigurationError if the cache has no state of it.
    """
    content = open_states(cache).get(state_name(store))
    if content is None:
        raise ConfigurationError(
            f"no sweep of {str(store)!r} is recorded in the cache {str(cache)!r}; "
            "give the store= and cache= of the sweep"
        )
    try:
        state = json.loads(content)
        counts_by_stage = state["stages"].items()
        stages = {
            name: (Progress(*counts), float(work)) for name, (*counts, work) in counts_by_stage
        }
        begun, updated = float(state["begun"]), float(state["at"])
        process, outcome = int(state["process"]), str(state["ended"])
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigurationError(
            f"cache is {str(cache)!r}, whose state of the sweep of {str(store)!r} cannot be read"
        ) from error
    renewed_ago = seconds_since_renewal(store)
    running = renewed_ago is not None and renewed_ago <= LEASE
    condition = f"running as process {process}" if running else outcome
    if renewed_ago is not None and not running:
        condition = (
            f"stopped: no sign of process {process} for {timedelta(seconds=round(renewed_ago))}"
        )
    sentence = (
        f"{store}: {condition}; begun {_format_clock(begun)}, state of {_format_clock(updated)}"
    )
    return sentence, _stage_table(stages, updated - begun, running)


def _stage_table(
    stages: Mapping[str, tuple[Progress, float]], elapsed: float, running: bool
) -> Table:
    """Return a table of cells and estimated time by stage, with totals in the last row."""
    total = Progress.sum(progress for progress, _ in stages.values())
    rows = {**dict(reversed([*stages.items()])), "all": (total, sum(w for _, w in stages.values()))}
    numbers = {
        name: (progress.total, progress.reused, progress.done, progress.failed, progress.remaining)
        + (time_left(work, total.seconds, elapsed),) * running
        for name, (progress, work) in rows.items()
    }
    headings = ("cells", "reused", "done", "failed", "left", *["time left"] * running)
    return count_table(numbers, *headings)


def _format_clock(seconds: float) -> str:
    return datetime.fromtimestamp(seconds).isoformat(" ", "seconds")
