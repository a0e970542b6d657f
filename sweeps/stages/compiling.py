"""The loops that draw, compiled by one process before others draw."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

from ncti.machine_code import is_kept
from ncti.render import loops
from sweeps.engine.settings import Choices
from sweeps.stages.flights import models
from sweeps.stages.views import Render, image

DRAW = frozenset({image.function, models.function})


def compile_loops(
    choices: Choices, functions: Collection[Callable[..., Any]], say: Callable[[str], None]
) -> None:
    """Compile the loops of all engines that draw, if any of some functions of stages draws."""
    if DRAW.intersection(functions):
        for engine in choices[Render.engine]:
            if not is_kept(loops.loops_of(engine)):
                say(f"compiling the loops over facets that {engine} runs, once: some seconds")
                loops.keep(engine)
