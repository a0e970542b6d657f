"""The cells of a sweep: the axes of every stage, the values at every place, and the keys."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

from sweeps.engine.code import code_digest
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import Value
from sweeps.engine.settings import Choices, Joint, Noting, Run, Setting
from sweeps.engine.stage import Argument, Bound, Experiment, Stage, bind, value_token

ENGINE = "sweeps.engine"

Place = tuple[int, ...]  # of a cell on the axes of its stage that have several values
Points = tuple[tuple[Value, ...], ...]


@dataclass(frozen=True)
class Axis:
    """An axis of a sweep: one setting, or several that run together.

    Attributes
    ----------
    name : str
        Name of its dimension.
    settings : tuple of Setting
        What runs along it.
    points : tuple of tuple
        A value of each setting, for every place.
    labels : tuple of str or None
        What each place is called, where settings run together.
    """

    name: str
    settings: tuple[Setting, ...]
    points: Points
    labels: tuple[str, ...] | None = None

    @property
    def several(self) -> bool:
        """Whether it has more than one place."""
        return len(self.points) > 1

    @property
    def is_joint(self) -> bool:
        """Whether it is a dimension of its own name, with its settings' values along it."""
        return self.labels is not None or len(self.settings) > 1


def axes_of(settings: Sequence[Setting], choices: Choices) -> tuple[Axis, ...]:
    """Every axis, those of settings that run together in the place of the first of them."""
    of_key: dict[str, Joint] = {key: joint for joint in choices.joint for key in joint.keys}
    by_key = {setting.key: setting for setting in settings}
    axes: list[Axis] = []
    done: set[str] = set()
    for setting in settings:
        joint = of_key.get(setting.key)
        if joint is None:
            points = tuple((value,) for value in choices[setting])
            axes.append(Axis(setting.name, (setting,), points))
        elif joint.name not in done:
            done.add(joint.name)
            members = tuple(by_key[key] for key in joint.keys)
            axes.append(Axis(joint.name, members, joint.points, joint.labels or ()))
    return tuple(axes)


class Plan:
    """What a sweep would compute: stages, their cells and the keys of these.

    Parameters
    ----------
    experiment : Experiment
        What is declared.
    choices : Choices
        Checked values of every setting.
    """

    def __init__(self, experiment: Experiment, choices: Choices) -> None:
        self.experiment = experiment
        self.choices = choices
        self.axes = axes_of(experiment.declared, choices)
        self._axis_of = {
            setting.key: (number, position)
            for number, axis in enumerate(self.axes)
            for position, setting in enumerate(axis.settings)
        }
        self._every = every = bind(experiment)
        wanted: set[str] = set()

        def want(bound: Bound) -> None:
            if bound.name not in wanted:
                wanted.add(bound.name)
                for source in bound.inputs:
                    want(source)

        for bound in every.values():
            if bound.stage.group is not None and bound.stage.when(choices):
                want(bound)
        self.bound = {name: bound for name, bound in every.items() if name in wanted}
        self.targets = tuple(
            bound
            for bound in self.bound.values()
            if bound.stage.group is not None and bound.stage.when(choices)
        )
        self._numbers: dict[Bound, tuple[int, ...]] = {}
        self._found: dict[tuple[Bound, str], tuple[Points, int | None, int]] = {}
        self._taken: dict[tuple[Bound, Bound], tuple[int, ...]] = {}
        self._gathered: dict[tuple[Bound, Bound], tuple[int, ...]] = {}
        self._keys: dict[str, dict[Place, str]] = {name: {} for name in self.bound}
        self._plain: dict[tuple[str, Place], Value] = {}
        self._whole: dict[tuple[str, str, Place], str] = {}
        for bound in self.bound.values():
            self._check_joint(bound)

    def unread(self, keys: Iterable[str]) -> list[str]:
        """Those of some keys that stages of the experiment read, but none of this plan."""
        read = {key for bound in self.bound.values() for key in (*bound.needs, *bound.gather)}
        known = {key for bound in self._every.values() for key in (*bound.needs, *bound.gather)}
        noting = Noting(self.choices.values, self.choices.joint)
        for bound in self._every.values():
            bound.stage.when(noting)
        read |= noting.asked
        read |= {
            setting.fallback.key
            for setting in self.experiment.declared
            if setting.key in read and setting.fallback is not None
        }
        return sorted(key for key in keys if key in known and key not in read)

    # axes -----------------------------------------------------------------------------------

    def axes_on(self, bound: Bound) -> tuple[int, ...]:
        """Numbers of the axes with several values that a stage depends on, ascending."""
        numbers = self._numbers.get(bound)
        if numbers is None:
            found = {self._axis_of[key][0] for key in bound.needs}
            numbers = tuple(number for number in sorted(found) if self.axes[number].several)
            self._numbers[bound] = numbers
        return numbers

    def axis_number(self, key: str) -> int:
        """Number of the axis that a setting runs along."""
        return self._axis_of[key][0]

    def axis_position(self, key: str) -> int:
        """Which of the settings of its axis a setting is."""
        return self._axis_of[key][1]

    def index_on(self, bound: Bound, number: int, place: Place) -> int:
        """Where on an axis a place of a stage is."""
        return place[self.axes_on(bound).index(number)] if self.axes[number].several else 0

    def together(self, bound: Bound) -> tuple[int, ...]:
        """Of these, those that it computes together."""
        return tuple(
            number
            for number in self.axes_on(bound)
            if len(self.axes[number].settings) == 1
            and self.axes[number].settings[0].key in bound.along
        )

    def gathered(self, bound: Bound) -> tuple[int, ...]:
        """Numbers of the axes that it wants whole, in the order in which it names them."""
        return tuple(self._axis_of[key][0] for key in bound.gather)

    def cells(self, bound: Bound) -> Iterator[Place]:
        """Places of all cells, the last axis fastest."""
        return product(*(range(len(self.axes[number].points)) for number in self.axes_on(bound)))

    def count(self, bound: Bound) -> int:
        """Number of its cells."""
        total = 1
        for number in self.axes_on(bound):
            total *= len(self.axes[number].points)
        return total

    def value(self, bound: Bound, key: str, place: Place) -> Value:
        """Value of a setting at a place of a stage."""
        found = self._found.get((bound, key))
        if found is None:
            number, position = self._axis_of[key]
            axis = self.axes[number]
            at = self.axes_on(bound).index(number) if axis.several else None
            found = self._found[bound, key] = axis.points, at, position
        points, at, position = found
        return points[0 if at is None else place[at]][position]

    def described(self, bound: Bound, place: Place) -> str:
        """A place in words: name=value for every axis that has several."""
        words = []
        for number, at in zip(self.axes_on(bound), place, strict=True):
            axis = self.axes[number]
            shown = axis.labels[at] if axis.labels else _shown(*axis.points[at])
            words.append(f"{axis.name}={shown}")
        return " ".join([bound.name, *words])

    def _check_joint(self, bound: Bound) -> None:
        for number in self.gathered(bound):
            axis = self.axes[number]
            if axis.several and axis.is_joint:
                raise ConfigurationError(
                    f"{axis.settings[0].key} runs together with other settings, but must run alone "
                    f"where {bound.name} looks at all of its values"
                )

    # inputs ---------------------------------------------------------------------------------

    def source_place(
        self, bound: Bound, source: Bound, place: Place, whole: dict[int, int] | None = None
    ) -> Place:
        """Place of the input's cell that a cell takes; with places on gathered axes in `whole`."""
        if not whole and not bound.stage.at:
            return tuple(place[at] for at in self._taken_from(bound, source))
        own = dict(zip(self.axes_on(bound), place, strict=True)) | (whole or {})
        for one, other in bound.stage.at.items():
            number, _ = self._axis_of[one.key]
            if one.key in source.needs and self.axes[number].several:
                own[number] = self.choices[one].index(self.value(bound, other.key, place))
        return tuple(own[number] for number in self.axes_on(source))

    def whole_axes(self, bound: Bound, source: Bound) -> tuple[int, ...]:
        """Numbers of the axes that a stage gathers of an input, as `Stage.gather` orders them."""
        numbers = self._gathered.get((bound, source))
        if numbers is None:
            there = set(self.axes_on(source))
            numbers = tuple(number for number in self.gathered(bound) if number in there)
            self._gathered[bound, source] = numbers
        return numbers

    def _taken_from(self, bound: Bound, source: Bound) -> tuple[int, ...]:
        """Which places on the axes of a stage are those of an input's cell."""
        taken = self._taken.get((bound, source))
        if taken is None:
            own = self.axes_on(bound)
            taken = tuple(own.index(number) for number in self.axes_on(source))
            self._taken[bound, source] = taken
        return taken

    def plain_value(self, bound: Bound, place: Place) -> Value:
        """Result of a plain stage at one of its places."""
        at = (bound.name, place)
        if at not in self._plain:
            arguments = {
                one.name: self.plain_argument(bound, one, place) for one in bound.arguments
            }
            try:
                self._plain[at] = bound.stage.function(**arguments)
            except ConfigurationError:
                raise
            except Exception as error:
                given = ", ".join(f"{name}={_shown(value)}" for name, value in arguments.items())
                raise ConfigurationError(
                    f"{bound.name} cannot be worked out of {given}: {error or type(error).__name__}"
                ) from error
        return self._plain[at]

    def plain_argument(self, bound: Bound, argument: Argument, place: Place) -> Value:
        """Value of an argument that is a setting or a plain stage."""
        if argument.setting is not None:
            if argument.setting.key in bound.gather:
                return self.choices[argument.setting]
            return self.value(bound, argument.setting.key, place)
        assert argument.source is not None
        return self.plain_value(argument.source, self.source_place(bound, argument.source, place))

    def stream(self, bound: Bound, place: Place) -> tuple[int, dict[str, Any]]:
        """Seed, and what names the stream of a cell's noise; see `sweeps.engine.seeds`."""
        seed = self.value(bound, Run.seed.key, place)
        name: dict[str, Any] = {"stage": bound.stage.noise or bound.name}
        if bound.stage.stream is None:
            for key in bound.needs:
                if key != Run.seed.key:
                    name[key] = self.value(bound, key, place)
            return seed, name
        for setting in bound.stage.stream:
            value = self.value(bound, setting.key, place)
            if value or setting not in bound.stage.optional:
                name[setting.name] = value
        return seed, name

    # keys -----------------------------------------------------------------------------------

    def key(self, bound: Bound, place: Place) -> str:
        """Hash of all that a cell depends on."""
        known = self._keys[bound.name]
        if place not in known:
            parts = [self._code[bound.name]]
            for argument in bound.arguments:
                source = argument.source
                if source is None or source.stage.plain:
                    value = self.plain_argument(bound, argument, place)
                    parts.append(f"{argument.name}={value_token(value)}")
                else:
                    parts.append(f"{argument.name}:{self._input_key(bound, source, place)}")
            if bound.random:
                parts.append(repr(self.stream(bound, place)))
            known[place] = digest("\0".join(parts))
        return known[place]

    def _input_key(self, bound: Bound, source: Bound, place: Place) -> str:
        """Key of an input's cell; of all cells together where it is gathered."""
        whole = self.whole_axes(bound, source)
        if not whole:
            return self.key(source, self.source_place(bound, source, place))
        first = self.first_source(bound, source, place)
        at = (bound.name, source.name, first)
        if at not in self._whole:
            keys = (self.key(source, there) for there in self.from_first(bound, source, first))
            self._whole[at] = digest("\0".join(keys))
        return self._whole[at]

    def sources(self, bound: Bound, source: Bound, place: Place) -> Iterator[tuple[Place, Place]]:
        """Place on the gathered axes, and the input's place, of all cells that a cell takes."""
        whole = self.whole_axes(bound, source)
        points = product(*(range(len(self.axes[number].points)) for number in whole))
        first = self.first_source(bound, source, place)
        return zip(points, self.from_first(bound, source, first), strict=True)

    def first_source(self, bound: Bound, source: Bound, place: Place) -> Place:
        """Place of the first of the input's cells that a cell takes."""
        whole = self.whole_axes(bound, source)
        return self.source_place(bound, source, place, dict.fromkeys(whole, 0))

    def from_first(self, bound: Bound, source: Bound, first: Place) -> Iterator[Place]:
        """Places of all cells of an input that a cell takes, whose first one is given."""
        whole = self.whole_axes(bound, source)
        numbers = self.axes_on(source)
        # As the gathering stage orders the axes, which need not be as the input does.
        ranges = [range(len(self.axes[number].points)) for number in whole]
        if not whole:
            yield first
            return
        order = [numbers.index(number) for number in whole]
        place = list(first)
        for point in product(*ranges):
            for at, index in zip(order, point, strict=True):
                place[at] = index
            yield tuple(place)

    def fingerprint(self, bound: Bound) -> str:
        """Hash of the keys of all cells of a stage."""
        return digest("".join(self.key(bound, place) for place in self.cells(bound)))

    @cached_property
    def _code(self) -> dict[str, str]:
        """Hash of the code of every stage, and of the libraries behind it."""
        # Two stages of one function share their results: its name counts, not theirs.
        return {
            name: digest(repr([_function_name(bound.stage), self.code[name]]))
            for name, bound in self.bound.items()
        }

    @cached_property
    def code(self) -> dict[str, str]:
        """Hash of the code of every stage that is not plain, for the store's attributes."""
        roots = frozenset((*self.experiment.code,))
        return {
            name: code_digest(
                bound.stage.function,
                roots=roots,
                without=frozenset({ENGINE}),
                also=bound.stage.also,
            ).digest
            for name, bound in self.bound.items()
        }


def digest(text: str) -> str:
    """32 hexadecimal digits that stand for a text."""
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def _function_name(stage: Stage) -> list[str]:
    function = inspect.unwrap(stage.function)
    return [function.__module__, function.__qualname__, *(one.name for one in stage.outputs)]


def _shown(*values: Value) -> str:
    return ",".join(f"{one:.12g}" if isinstance(one, float) else str(one) for one in values)
