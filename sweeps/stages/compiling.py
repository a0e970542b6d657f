"""Compilation of the loops of stages, by one process before others run them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import Any

from ncti.infrared.loops import IMAGES
from ncti.irar.loops import TILTS
from ncti.ladar.loops import FRAMES
from ncti.machine_code import Loops
from ncti.render.choice import choose_engine
from ncti.render.loops import MASK, of_engine
from sweeps.engine.settings import Choices
from sweeps.stages.flights import corrected, models
from sweeps.stages.images import image_window, template_log_polar
from sweeps.stages.infrared import look, silhouette_engine
from sweeps.stages.ladar import averaged
from sweeps.stages.views import LINES, RUN_TIME, Render, image, looks

Functions = Collection[Callable[..., Any]]

DRAW = frozenset(one.function for one in (image, models))
IMAGE = frozenset(one.function for one in (look, template_log_polar, image_window))


def compile_loops(choices: Choices, functions: Functions, say: Callable[[str], None]) -> None:
    """Compile the loops that some stage functions run, except those already compiled."""
    for loops in _loops_of(choices, functions):
        if loops.are_missing():
            say(f"compiling the loops of {loops.of} (once, a few seconds)")
            from ncti.compiled import keep  # numba takes long to import

            keep(loops)


def _loops_of(choices: Choices, functions: Functions) -> Iterator[Loops]:
    drawn, imaged = (not among.isdisjoint(functions) for among in (DRAW, IMAGE))
    drawn |= looks(RUN_TIME)(choices)  # whose stages call what draws by themselves
    engines = choices[Render.engine]
    yield from (of_engine(one) for one in engines if drawn or (imaged and one == LINES))
    if LINES in engines and models.function in functions:
        yield of_engine(choose_engine("auto"))  # it needs pixels
    if averaged.function in functions:
        yield FRAMES
    if imaged:
        if MASK in map(silhouette_engine.function, engines):
            yield of_engine(MASK)
        yield IMAGES
    if corrected.function in functions:
        yield TILTS
