"""The cells of a sweep: axes of every stage, values at every place, and keys."""

from __future__ import annotations

import hashlib
import inspect
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from math import prod
from typing import Any

from sweeps.engine.code import code_digest
from sweeps.engine.errors import ConfigurationError, DeclarationError
from sweeps.engine.kinds import Value
from sweeps.engine.process import uncollected
from sweeps.engine.seeds import STREAM_VERSION
from sweeps.engine.settings import Choices, Joint, Noting, Run, Setting
from sweeps.engine.stage import Argument, Bound, Experiment, bind, value_token

ENGINE = "sweeps.engine"

Place = tuple[int, ...]  # of a cell on the axes of its stage that have several values
Points = tuple[tuple[Value, ...], ...]


@dataclass(frozen=True)
class Axis:
    """An axis of a sweep: one setting, or several that run together."""

    name: str
    settings: tuple[Setting, ...]
    points: Points  # a value of each setting, for every place
    labels: tuple[str, ...] | None = None  # of the places, where settings run together

    @property
    def several(self) -> bool:
        """Whether it has more than one place."""
        return len(self.points) > 1

    @property
    def is_joint(self) -> bool:
        """Return whether it is a joint dimension, with values of its settings along it."""
        return self.labels is not None or len(self.settings) > 1


def axes_of(settings: Sequence[Setting], choices: Choices) -> tuple[Axis, ...]:
    """Return every axis; a joint one takes the place of the first of its settings."""
    of_key: dict[str, Joint] = {key: joint for joint in choices.joint for key in joint.keys}
    by_key = {setting.key: setting for setting in settings}
    axes: dict[str | Setting, Axis] = {}
    for setting in settings:
        joint = of_key.get(setting.key)
        if joint is None:
            points = tuple((value,) for value in choices[setting])
            axes[setting] = Axis(setting.name, (setting,), points)
        elif joint.name not in axes:
            members = tuple(by_key[key] for key in joint.keys)
            axes[joint.name] = Axis(joint.name, members, joint.points, joint.labels or ())
    return tuple(axes.values())


class Plan:
    """Plan of a sweep: stages, their cells and the keys of these."""

    def __init__(self, experiment: Experiment, choices: Choices) -> None:
        self.experiment = experiment
        self.choices = choices
        self.axes = axes_of(experiment.declared, choices)
        self._axis_of = {
            setting.key: (number, position)
            for number, axis in enumerate(self.axes)
            for position, setting in enumerate(axis.settings)
        }
        self._every = bind(experiment, choices.joint)
        self.targets = tuple(
            bound
            for bound in self._every.values()
            if bound.stage.group is not None and bound.stage.when(choices)
        )
        wanted = set(self.targets)
        for bound in reversed(self._every.values()):  # each comes after those that it needs
            if bound in wanted:
                wanted.update(bound.inputs)
        self.bound = {name: bound for name, bound in self._every.items() if bound in wanted}
        # Cached: looked up some hundred thousand times.
        self.axes_on = cache(self._axes_on)
        self.whole_axes = cache(self._whole_axes)
        self.plain_value = cache(self._plain_value)
        self.key = cache(self._key)
        self._taken = cache(self._taken_from)
        self._where = cache(self._where_on)
        self._whole_key = cache(self._key_of_all)
        for bound in (one for one in self.bound.values() if not one.stage.plain):
            for axis in (self.axes[number] for number in self.gathered(bound)):
                if axis.several and axis.is_joint:
                    raise ConfigurationError(
                        f"{axis.settings[0].key} runs together with other settings, but must run "
                        f"alone because {bound.name} uses all of its values"
                    )
        self._places_at = {
            (bound, source, one): self._moved(bound, source, one, other)
            for bound in self.bound.values()
            for one, other in bound.stage.at.items()
            for source in bound.inputs
            if one.key in source.needs
        }

    def unread(self, keys: Iterable[str]) -> list[str]:
        """Return which of some keys the experiment's stages read, but none of this plan does."""
        read, known = (
            {key for bound in stages for key in (*bound.needs, *bound.gather)}
            for stages in (self.bound.values(), self._every.values())
        )
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

    @property
    def modules(self) -> list[str]:
        """Sorted names of the modules of its stages."""
        return sorted({one.stage.function.__module__ for one in self.bound.values()})

    # axes -----------------------------------------------------------------------------------

    @property
    def swept(self) -> dict[str, int]:
        """Return the number of values of every axis of several that a stage depends on."""
        read = {number for one in self.bound.values() for number in self.axes_on(one)}
        read |= {number for one in self.bound.values() for number in self.gathered(one)}
        return {
            "+".join(one.key for one in axis.settings): len(axis.points)
            for number, axis in enumerate(self.axes)
            if axis.several and number in read
        }

    def _axes_on(self, bound: Bound) -> tuple[int, ...]:
        """Return numbers of the axes with several values that a stage depends on, ascending."""
        found = {self._axis_of[key][0] for key in bound.needs}
        return tuple(number for number in sorted(found) if self.axes[number].several)

    def axis_number(self, key: str) -> int:
        """Return the number of a setting's axis."""
        return self._axis_of[key][0]

    def together(self, bound: Bound) -> tuple[int, ...]:
        """Return numbers of the axes with several values that a stage computes together."""
        return tuple(
            number
            for number in self.axes_on(bound)
            if len(self.axes[number].settings) == 1
            and self.axes[number].settings[0].key in bound.along
        )

    def gathered(self, bound: Bound) -> tuple[int, ...]:
        """Return numbers of the axes that a stage gathers, in the order in which it names them."""
        return tuple(self._axis_of[key][0] for key in bound.gather)

    def cells(self, bound: Bound) -> Iterator[Place]:
        """Yield places of all cells of a stage, the last axis fastest."""
        return self._places(self.axes_on(bound))

    def count(self, bound: Bound) -> int:
        """Return the number of cells of a stage."""
        return prod(len(self.axes[number].points) for number in self.axes_on(bound))

    def _places(self, numbers: Iterable[int]) -> Iterator[Place]:
        return product(*(range(len(self.axes[number].points)) for number in numbers))

    def value(self, bound: Bound, key: str, place: Place) -> Value:
        """Return the value of a setting at a place of a stage."""
        points, at, position = self._where(bound, key)
        return points[0 if at is None else place[at]][position]

    def _where_on(self, bound: Bound, key: str) -> tuple[Points, int | None, int]:
        """Return points of a setting's axis, and its position in a stage's places and points."""
        number, position = self._axis_of[key]
        axis = self.axes[number]
        return axis.points, self.axes_on(bound).index(number) if axis.several else None, position

    def described(self, bound: Bound, place: Place) -> str:
        """Return a place in words: name=value for every axis of several values."""
        words = [bound.name]
        for number, at in zip(self.axes_on(bound), place, strict=True):
            axis = self.axes[number]
            words.append(f"{axis.name}={axis.labels[at] if axis.labels else _shown(axis, at)}")
        return " ".join(words)

    # inputs ---------------------------------------------------------------------------------

    def source_place(
        self, bound: Bound, source: Bound, place: Place, moved: Mapping[int, int] | None = None
    ) -> Place:
        """Return the place of the input's cell that a cell takes, `moved` on some axes."""
        if not moved and not bound.stage.at:
            return tuple([place[at] for at in self._taken(bound, source)])
        own = dict(zip(self.axes_on(bound), place, strict=True)) | dict(moved or {})
        there = dict(own)
        for one, other in bound.stage.at.items():
            if (bound, source, one) in self._places_at:
                number, _ = self._axis_of[one.key]
                value = self.value(bound, other.key, place)
                there[number] = self._places_at[bound, source, one][value, own.get(number)]
        return tuple([there[number] for number in self.axes_on(source)])

    def _moved(
        self, bound: Bound, source: Bound, one: Setting, other: Setting
    ) -> dict[tuple[Value, int | None], int]:
        """Return places of an input on the axis of a setting that takes the value of another.

        By that value, and by the stage's own place on that axis, if it has one.

        Raises
        ------
        ConfigurationError
            If the axis lacks a value, or settings that run together leave the place open.
        """
        number, position = self._axis_of[one.key]
        axis, (at, part) = self.axes[number], self._axis_of[other.key]
        read = [k for k, member in enumerate(axis.settings) if member.key in source.needs]
        owned = number in self.axes_on(bound)
        found: dict[tuple[Value, int | None], int] = {}
        for own in range(len(axis.points)) if owned else (None,):
            others = self.axes[at].points if own is None or at != number else [axis.points[own]]
            for value in (point[part] for point in others):
                fitting = [k for k, point in enumerate(axis.points) if point[position] == value]
                if not fitting:
                    raise ConfigurationError(
                        f"{other.key} has {_word(value)}, but every value must be one of "
                        f"{one.key}, because {bound.name} takes {source.name} there"
                    )
                several = len({tuple(axis.points[k][r] for r in read) for k in fitting}) > 1
                if own in fitting:
                    found[value, own] = own
                elif several or (owned and len(read) > 1):
                    raise ConfigurationError(
                        f"{one.key} runs together with other settings, but must run alone "
                        f"because {bound.name} takes {source.name} at the value of {other.key}"
                    )
                else:
                    found[value, own] = fitting[0]
        return found

    def _taken_from(self, bound: Bound, source: Bound) -> tuple[int, ...]:
        """Return which places on the axes of a stage are those of an input's cell."""
        own = self.axes_on(bound)
        return tuple(own.index(number) for number in self.axes_on(source))

    def _whole_axes(self, bound: Bound, source: Bound) -> tuple[int, ...]:
        """Return numbers of the axes gathered of an input, in the order of `Stage.gather`."""
        there = self.axes_on(source)
        return tuple(number for number in self.gathered(bound) if number in there)

    def sources(self, bound: Bound, source: Bound, place: Place) -> Iterator[tuple[Place, Place]]:
        """Yield place on the gathered axes, and the input's place, of all cells taken."""
        points = self._places(self.whole_axes(bound, source))
        first = self.first_source(bound, source, place)
        return zip(points, self.from_first(bound, source, first), strict=True)

    def first_source(self, bound: Bound, source: Bound, place: Place) -> Place:
        """Return the place of the first of the input's cells that a cell takes."""
        whole = self.whole_axes(bound, source)
        return self.source_place(bound, source, place, dict.fromkeys(whole, 0))

    def from_first(self, bound: Bound, source: Bound, first: Place) -> Iterator[Place]:
        """Yield places of all cells of an input that a cell takes, given the first."""
        whole = self.whole_axes(bound, source)
        # In the order of the gathering stage, which may differ from that of the input.
        order = [self.axes_on(source).index(number) for number in whole]
        place = list(first)
        for point in self._places(whole):
            for at, index in zip(order, point, strict=True):
                place[at] = index
            yield tuple(place)

    def _plain_value(self, bound: Bound, place: Place) -> Value:
        """Return the result of a plain stage at one of its places."""
        given = {one.name: self.plain_argument(bound, one, place) for one in bound.arguments}
        try:
            return bound.stage.checked_value(bound.stage.function(**given))
        except (ConfigurationError, DeclarationError):
            raise
        except Exception as error:
            words = ", ".join(f"{name}={_word(value)}" for name, value in given.items())
            raise ConfigurationError(
                f"{bound.name} cannot be computed from {words}: {error or type(error).__name__}"
            ) from error

    def plain_argument(self, bound: Bound, argument: Argument, place: Place) -> Value:
        """Return the value of an argument that is a setting or a plain stage."""
        if argument.setting is not None:
            if argument.setting.key in bound.gather:
                return self.choices[argument.setting]
            return self.value(bound, argument.setting.key, place)
        assert argument.source is not None
        return self.plain_value(argument.source, self.source_place(bound, argument.source, place))

    def stream(self, bound: Bound, place: Place) -> tuple[int, dict[str, Any]]:
        """Return the seed and the names of a cell's noise stream; see `sweeps.engine.seeds`."""
        name: dict[str, Any] = {"stage": bound.stage.noise or bound.name}
        if bound.stage.stream is None:
            keys = [key for key in bound.needs if key != Run.seed.key]
            name |= {key: self.value(bound, key, place) for key in keys}
        for setting in bound.stage.stream or ():
            value = self.value(bound, setting.key, place)
            if value or setting not in bound.stage.optional:
                name[setting.name] = value
        return self.value(bound, Run.seed.key, place), name

    # keys -----------------------------------------------------------------------------------

    def _key(self, bound: Bound, place: Place) -> str:
        """Return the hash of everything that a cell depends on."""
        parts = [self._code[bound.name]]
        for argument in bound.arguments:
            source = argument.source
            if source is None or source.stage.plain:
                value = self.plain_argument(bound, argument, place)
                parts.append(f"{argument.name}={value_token(value)}")
            elif self.whole_axes(bound, source):
                first = self.first_source(bound, source, place)
                parts.append(f"{argument.name}:{self._whole_key(bound, source, first)}")
            else:
                there = self.source_place(bound, source, place)
                parts.append(f"{argument.name}:{self.key(source, there)}")
        if bound.random:
            parts.append(repr((STREAM_VERSION, *self.stream(bound, place))))
        return digest("\0".join(parts))

    def _key_of_all(self, bound: Bound, source: Bound, first: Place) -> str:
        """Return one hash of all cells that a stage gathers of an input."""
        return digest(
            "\0".join(self.key(source, there) for there in self.from_first(bound, source, first))
        )

    def fingerprint(self, bound: Bound) -> str:
        """Return the hash of the keys of all cells of a stage."""
        return digest("".join(self.key(bound, place) for place in self.cells(bound)))

    @cached_property
    def _code(self) -> dict[str, str]:
        """Return by stage the hash of its code and of the names of its function and outputs."""
        # Two stages of one function share their results: its name counts, not theirs. Functions
        # of one name, such as lambdas, are told apart by the names of their stages.
        functions = {name: inspect.unwrap(one.stage.function) for name, one in self._every.items()}
        named: dict[tuple[str, str], set[int]] = defaultdict(set)
        for one in functions.values():
            named[one.__module__, one.__qualname__].add(id(one))
        found = {}
        for name, bound in self.bound.items():
            place = functions[name].__module__, functions[name].__qualname__
            outputs = [(one.name, one.dtype, repr(one.empty)) for one in bound.stage.outputs]
            own = [name] if len(named[place]) > 1 else []
            order = (bound.along, bound.gather)  # of the axes of arguments and results
            found[name] = digest(repr([[*place, *outputs, *own], order, self.code[name]]))
        return found

    @cached_property
    @uncollected()
    def code(self) -> dict[str, str]:
        """Return by stage the hash of its code and libraries, for the store's attributes."""
        roots, without = frozenset(self.experiment.code), frozenset({ENGINE})
        return {
            name: code_digest(
                bound.stage.function,
                roots=roots,
                without=without,
                also=(*bound.stage.also, *(("numpy",) if bound.random else ())),  # of its draws
            ).digest
            for name, bound in self.bound.items()
        }


def digest(text: str) -> str:
    """Return a hash of a text: 32 hexadecimal digits."""
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def _shown(axis: Axis, at: int) -> str:
    return ",".join(map(_word, axis.points[at]))


def _word(value: Value) -> str:
    return f"{value:.12g}" if isinstance(value, float) else str(value)
