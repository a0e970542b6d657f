"""Calls that are left, what each of them waits for, and which are next.

Calls are numbered so that those that share in-memory objects are neighbours, closest where they
share most. A call waits for missing results; or for a gate, which several calls may share: all that
one of them gathers, or all that an in-memory object is made of.
"""

from __future__ import annotations

import heapq
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.keys import joined
from sweeps.engine.plan import Cells, Plan
from sweeps.engine.stage import Bound

MOST_CELLS = 4096  # of one task

Job = tuple[Bound, Cells]  # cells of a stage that one call computes


class Waiting:
    """Calls for missing cells; those of stages without in-memory objects come first."""

    def __init__(
        self,
        plan: Plan,
        nodes: Mapping[Bound, Cells],
        absent: NDArray[np.bool_],
        missing: Mapping[Bound, Cells],
    ) -> None:
        """Plan calls.

        Parameters
        ----------
        plan : Plan
            What depends on what.
        nodes : mapping of Bound to (cell,) ndarray
            Number of the result of every cell that is needed.
        absent : (node,) ndarray of bool
            Which results are missing.
        missing : mapping of Bound to (cell,) ndarray
            The cells to be computed by stage, one of each result.
        """
        self._plan, self._nodes, self._absent = plan, nodes, absent
        self._stages = [*missing]
        self._split: deque[Job] = deque()
        self._numbers: dict[bytes, int] = {}  # of in-memory objects, by key
        tables = [self._calls(number, cells) for number, cells in enumerate(missing.values())]
        width = max((objects.shape[1] for _, _, objects, _ in tables), default=0)
        fill = [np.full((len(o), width), -1, np.int64) for _, _, o, _ in tables]
        for padded, (_, _, objects, _) in zip(fill, tables, strict=True):
            padded[:, : objects.shape[1]] = objects
        empty = np.empty(0, dtype=np.int32)
        lengths = joined(empty, *(lengths for _, lengths, _, _ in tables))
        self._stage = joined(empty, *(stage for stage, _, _, _ in tables))
        self._cells = joined(empty, *(cells for _, _, _, cells in tables))
        self._objects = joined(np.empty((0, width), np.int64), *fill)
        if width:
            order = np.lexsort(self._objects.T[::-1])
            begins = np.cumsum(lengths) - lengths
            self._stage, self._objects = self._stage[order], self._objects[order]
            lengths = lengths[order]
            self._cells = self._cells[_ranges(begins[order], lengths)]
        self._begins = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
        self._wait()
        del self._nodes, self._absent, self._numbers, self._known

    def _calls(self, number: int, cells: Cells) -> tuple[Cells, Cells, Cells, Cells]:
        """Return stage, number of cells and in-memory objects of each call; and all their cells.

        Cells that differ only on axes computed together share a call.
        """
        bound = self._stages[number]
        starts = self._plan.start(bound, cells)
        objects = np.array(self._shared(bound, starts)).reshape(-1, len(cells))
        if len(objects) or bound.along:
            order = np.lexsort((cells, starts, *objects[::-1]))
            cells, starts, objects = cells[order], starts[order], objects[:, order]
        begins = np.flatnonzero(np.diff(starts, prepend=-1))
        lengths = np.diff(begins, append=len(cells))
        stage = np.full(len(begins), number, dtype=np.int16)
        return stage, lengths.astype(np.int32), objects.T[begins], cells.astype(np.int32)

    def _shared(self, bound: Bound, cells: Cells) -> list[Cells]:
        """Return numbers of the in-memory objects that cells need, dependencies first."""
        found: list[Cells] = []
        for source, first, _ in self._plan.inputs(bound):
            if source.stage.memory:
                taken, places = np.unique(first[cells], return_inverse=True)
                keys = (key.tobytes() for key in self._plan.keys(source, taken))
                own = [self._numbers.setdefault(key, len(self._numbers)) for key in keys]
                found += [*self._shared(source, first[cells]), np.array(own)[places]]
        return found

    # what they wait for ---------------------------------------------------------------------

    def _wait(self) -> None:
        """Find what each call waits for, and which wait for nothing."""
        self._gates = len(self._absent)  # number of the first gate, behind the nodes
        self._known: dict[Bound | tuple[Bound, Bound], Cells] = {}  # gates by where they begin
        edges: list[tuple[Cells, Cells]] = []  # node or gate, and the call or gate that waits
        count, calls = 0, len(self._stage)
        for number, bound in enumerate(self._stages):
            if not self._plan.inputs(bound):
                continue
            own = np.flatnonzero(self._stage == number)
            own = np.repeat(own, np.diff(self._begins)[own])
            cells = self._cells[np.repeat(self._stage == number, np.diff(self._begins))]
            count = self._edges(bound, cells, own, count, edges)
        empty = np.empty(0, dtype=np.int64)
        sources = joined(empty, *(source for source, _ in edges))
        self._targets = joined(empty, *(target for _, target in edges))
        order = np.argsort(sources, kind="stable")
        self._targets = self._targets[order]
        things = self._gates + count
        self._from = np.searchsorted(sources[order], np.arange(things + 1)) if len(order) else None
        self._left = np.zeros(calls + count, dtype=np.int32)
        np.add.at(self._left, self._targets, 1)
        self._later: list[int] = []
        open_gates = np.flatnonzero(self._left[calls:] == 0)
        # Calls that wait for nothing, and then those that only waited for open gates.
        ready = self._left[:calls] == 0
        self._first, self._at = np.flatnonzero(ready).astype(np.int32), 0
        lengths, stages = np.diff(self._begins)[self._first], self._stage[self._first]
        self.load = Counter(
            {bound: int(lengths[stages == n].sum()) for n, bound in enumerate(self._stages)}
        )
        self.release(self._gates + open_gates)

    def _edges(
        self,
        bound: Bound,
        cells: Cells,
        waiting: Cells,
        count: int,
        edges: list[tuple[Cells, Cells]],
    ) -> int:
        """Add what cells of a stage, and thus calls or gates, wait for; return number of gates."""
        for source, first, further in self._plan.inputs(bound):
            kept = source.stage.kept
            starts = first[cells]
            if kept and further.size == 1:
                nodes = self._nodes[source][starts + further.ravel()]
                absent = self._absent[nodes]
                edges.append((nodes[absent], waiting[absent]))
                continue
            # The same gate for all that take the same.
            known = self._known.setdefault(
                (bound, source) if kept else source,
                np.full(self._plan.count(source), -1, dtype=np.int64),
            )
            new = np.unique(starts[known[starts] < 0])
            known[new] = count + np.arange(len(new))
            count += len(new)
            edges.append((self._gates + known[starts], waiting))
            behind = len(self._stage) + np.repeat(known[new], further.size)
            taken = (new[:, None] + further.ravel()).ravel()
            if kept:
                nodes = self._nodes[source][taken]
                absent = self._absent[nodes]
                edges.append((nodes[absent], behind[absent]))
            else:
                count = self._edges(source, taken, behind, count, edges)
        return count

    def release(self, nodes: Cells) -> None:
        """Let go what waits for nodes that are finished or failed, or for gates that are open."""
        calls = len(self._stage)
        while len(nodes) and self._from is not None:
            begins = self._from[nodes]
            targets = self._targets[_ranges(begins, self._from[nodes + 1] - begins)]
            np.subtract.at(self._left, targets, 1)
            free = np.unique(targets[self._left[targets] == 0])
            for call in free[free < calls].tolist():
                heapq.heappush(self._later, call)
                length = int(self._begins[call + 1] - self._begins[call])
                self.load[self._stages[self._stage[call]]] += length
            nodes = free[free >= calls] - calls + self._gates

    # what is next ---------------------------------------------------------------------------

    @property
    def ready(self) -> bool:
        """Whether there are calls that wait for nothing."""
        return bool(self._split or self._later or self._at < len(self._first))

    def counts(self) -> list[tuple[Bound, int, int]]:
        """Return stages, and for each how many cells are in how many calls, of all planned."""
        cells = np.bincount(self._stage, np.diff(self._begins), minlength=len(self._stages))
        calls = np.bincount(self._stage, minlength=len(self._stages))
        return [*zip(self._stages, cells.astype(int).tolist(), calls.tolist(), strict=True)]

    def add(self, jobs: Iterable[Job]) -> None:
        """Add calls that wait for nothing."""
        for bound, cells in jobs:
            self._split.append((bound, cells))
            self.load[bound] += len(cells)

    def next(self, costs: Mapping[str, float], size: float, together: float) -> Iterator[Job]:
        """Remove and yield calls that take about `size` seconds, by the cost of a cell of a stage.

        Up to `together` where calls share two in-memory objects, and have a third.
        """
        seconds, cells = 0.0, 0
        before: list[int] = []
        # At least one, even if a damaged index has wrong costs.
        while self.ready and cells < MOST_CELLS:
            at = self._next()
            objects = [] if at is None else self._objects[at].tolist()
            shared = len(objects) > 2 and objects[2] >= 0 and objects[:2] == before
            if cells and seconds >= (together if shared else size):
                break
            bound, own = self._split.popleft() if at is None else self._pop(at)
            before = objects[:2]
            seconds += costs[bound.name] * len(own)
            cells += len(own)
            self.load[bound] -= len(own)
            yield bound, own

    def _next(self) -> int | None:
        """Return the first of the calls that are ready; None for one that was split."""
        if self._split:
            return None
        first = int(self._first[self._at]) if self._at < len(self._first) else None
        later = self._later[0] if self._later else None
        return min(one for one in (first, later) if one is not None)

    def _pop(self, call: int) -> Job:
        if self._later and self._later[0] == call:
            heapq.heappop(self._later)
        else:
            self._at += 1
        own = self._cells[self._begins[call] : self._begins[call + 1]]
        return self._stages[self._stage[call]], own


def _ranges(begins: Cells, lengths: Cells) -> Cells:
    """Return the numbers of several ranges, one after the other."""
    ends = np.cumsum(lengths)
    return np.arange(ends[-1] if len(ends) else 0) + np.repeat(begins - ends + lengths, lengths)
