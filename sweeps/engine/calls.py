"""Calls of stages, made ready for a worker: where it finds each argument."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from sweeps.engine.inputs import Made, Read, Recipe, Source, Spot, Stack, Step, Value
from sweeps.engine.tasks import Call

if TYPE_CHECKING:
    from sweeps.engine.plan import Place, Plan
    from sweeps.engine.stage import Bound


class CallMaker:
    """Maker of the calls of a plan.

    Parameters
    ----------
    plan : Plan
        What is wanted.
    spots : mapping of str to Spot
        Where the cells are that are there, by key; read at each call.
    stored_key : callable
        Stage, place -> key under which the cell is kept.
    """

    def __init__(
        self,
        plan: Plan,
        spots: Mapping[str, Spot],
        stored_key: Callable[[Bound, Place], str],
    ) -> None:
        self.plan = plan
        self.spots = spots
        self.stored_key = stored_key
        self._steps: dict[str, Step] = {}

    def call(self, bound: Bound, places: Sequence[Place]) -> Call:
        """One call for cells that differ only on the axes that their stage computes together."""
        plan = self.plan
        along = plan.together(bound)
        numbers = plan.axes_on(bound)
        values = {
            number: sorted({place[numbers.index(number)] for place in places}) for number in along
        }
        # As the stage orders them; those of one value are there, too.
        order = [plan.axis_number(key) for key in bound.along]
        shape = tuple(len(values.get(number, (0,))) for number in order)
        cells = []
        for place in places:
            point = [values[n].index(place[numbers.index(n)]) if n in values else 0 for n in order]
            at = int(np.ravel_multi_index(point, shape)) if order else 0
            cells.append((self.stored_key(bound, place), at))
        recipe = self._recipe(bound, places[0], values)
        return Call(self._step(bound), recipe, shape, tuple(cells))

    def _step(self, bound: Bound) -> Step:
        if bound.name not in self._steps:
            self._steps[bound.name] = Step.of(bound.stage)
        return self._steps[bound.name]

    def _recipe(self, bound: Bound, place: Place, values: dict[int, list[int]]) -> Recipe:
        """Arguments of a call for some places on the axes that it computes together."""
        plan = self.plan
        sources: dict[str, Source] = {}
        there: np.ndarray | None = None
        for argument in bound.arguments:
            source = argument.source
            if argument.setting is not None and argument.setting.key in bound.along:
                number = plan.axis_number(argument.setting.key)
                points = plan.axes[number].points
                position = plan.axis_position(argument.setting.key)
                at = values.get(number) or [plan.index_on(bound, number, place)]
                sources[argument.name] = Value(tuple(points[i][position] for i in at))
            elif source is None or source.stage.plain:
                sources[argument.name] = Value(plan.plain_argument(bound, argument, place))
            else:
                sources[argument.name], known = self._source(bound, source, place, values)
                if known is not None:
                    there = known if there is None else there & known
        stream = plan.stream(bound, place) if bound.random else None
        flags = None if there is None else (there.shape, there.tobytes())
        return Recipe(sources, stream, flags)

    def _source(
        self, bound: Bound, source: Bound, place: Place, values: dict[int, list[int]]
    ) -> tuple[Source, np.ndarray | None]:
        """An input, and of a gathered one which of its cells are there."""
        plan = self.plan
        whole = plan.whole_axes(bound, source)
        if not source.stage.kept:
            at = plan.source_place(bound, source, place)
            return Made(
                self._step(source), self.stored_key(source, at), self._recipe(source, at, {})
            ), None
        # In the order of the stage: axes computed together, then those that it gathers.
        keys = [*bound.along, *bound.gather]
        axes: list[tuple[int, list[int]]] = []
        for key in keys:
            number = plan.axis_number(key)
            if key not in source.needs:
                continue
            if key in bound.gather:
                axes.append((number, list(range(len(plan.axes[number].points)))))
            elif number in values:
                axes.append((number, values[number]))
            else:
                axes.append((number, [plan.index_on(bound, number, place)]))
        if not axes:
            at = plan.source_place(bound, source, place)
            key = self.stored_key(source, at)
            return Read(self._step(source), key, self.spots[plan.key(source, at)]), None
        shape = tuple(len(points) for _, points in axes)
        flat, found, spots = [], [], []
        for number, point in enumerate(product(*(points for _, points in axes))):
            at = plan.source_place(
                bound, source, place, dict(zip((n for n, _ in axes), point, strict=True))
            )
            key = plan.key(source, at)
            if key in self.spots:
                flat.append(number)
                found.append(self.stored_key(source, at))
                spots.append(self.spots[key])
        stack = Stack(self._step(source), shape, tuple(flat), tuple(found), tuple(spots))
        if not whole and not bound.gather:
            return stack, None
        every = np.zeros(math.prod(shape), dtype=bool)
        every[flat] = True
        gathered = [number for number, _ in axes if number in plan.gathered(bound)]
        together = tuple(range(len(axes) - len(gathered)))
        known = np.asarray(every.reshape(shape).all(axis=together))
        # Along the axes on which the input does not depend, every cell is there if one is.
        lacking = [k for k, n in enumerate(plan.gathered(bound)) if n not in gathered]
        lengths = [len(plan.axes[number].points) for number in plan.gathered(bound)]
        return stack, np.broadcast_to(np.expand_dims(known, lacking), lengths)
