"""Plan of a sweep: the axes of every stage, its numbered cells, and their keys.

Cells of a stage are numbered over its swept axes, the last axis fastest. Array arithmetic on these
numbers gives the input cells that each cell reads.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.declare.errors import ConfigurationError, DeclarationError
from sweeps.engine.declare.failures import RAISED
from sweeps.engine.declare.kinds import Draws, Value, format_value
from sweeps.engine.declare.settings import Choices, Run, Setting
from sweeps.engine.declare.stage import BoundStage, Experiment, bind, value_token
from sweeps.engine.resolve.code import Code, CodeDigest, module_and_name
from sweeps.engine.resolve.keys import Keys, digest, fold, hash_texts, key_text
from sweeps.engine.resolve.modules import save_parsed_modules
from sweeps.engine.resolve.streams import STREAM_VERSION

Indices = NDArray[np.signedinteger[Any]]
Cells = Indices  # numbers of cells of a stage

MAX_CELLS = 10_000_000  # of a sweep, whose keys fit into memory
HASHED_CELLS = 2**18  # cells that are hashed together
NOT_CALLED = object()  # placeholder: this derived stage has not been called yet
STREAM_WORDS = ("seed", "stage")  # reserved labels in the name of a stream


@dataclass(frozen=True)
class Axis:
    """An axis of a sweep: one setting, or several that run together."""

    name: str
    settings: tuple[Setting, ...]
    points: tuple[tuple[Value, ...], ...]  # the values of all settings, by position
    labels: tuple[str, ...] | None = None  # of the positions of a zipped axis
    unlabelled: bool = False  # see `ZippedAxis`

    @property
    def is_swept(self) -> bool:
        """Whether it has several values."""
        return len(self.points) > 1

    @property
    def is_zipped(self) -> bool:
        """Whether several settings run along it, or its positions have labels."""
        return self.labels is not None or len(self.settings) > 1


def make_axes(settings: Sequence[Setting], choices: Choices) -> tuple[Axis, ...]:
    """Return every axis; a zipped axis stands where the first of its settings does."""
    by_key = {setting.key: setting for setting in settings}
    axes = {
        setting.key: Axis(setting.name, (setting,), tuple((v,) for v in choices[setting]))
        for setting in settings
    }
    for zipped in choices.zipped:
        members = tuple(by_key[key] for key in zipped.keys)
        axis = Axis(zipped.name, members, zipped.points, zipped.labels or (), zipped.unlabelled)
        axes |= dict.fromkeys(zipped.keys, axis)
    return tuple({id(axis): axis for axis in axes.values()}.values())


class InputCells(NamedTuple):
    """Cells of an input that the cells of a stage read.

    `first`, (cell,), is the first input cell of each cell of the stage. Add `offsets`, (gathered
    axis, ...), to it for every position on the gathered axes of the input, in the order of
    `Stage.gather`.
    """

    source: BoundStage
    first: Cells
    offsets: Cells

    def select(self, cells: Cells) -> Cells:
        """Return the distinct input cells that cells read, (distinct first cell, offset)."""
        return np.unique(self.first[cells])[:, None] + self.offsets.ravel()


def stored_stages(stages: Iterable[BoundStage], choices: Choices) -> tuple[BoundStage, ...]:
    """Return the stages whose results the store of a sweep has."""
    groups = ((bound, bound.stage.group) for bound in stages)
    return tuple(bound for bound, group in groups if group.path and group.when(choices))


def with_inputs(
    targets: Iterable[BoundStage], stages: Mapping[str, BoundStage]
) -> dict[str, BoundStage]:
    """Return `targets` and all their direct and indirect inputs, in the order of `stages`."""
    included = set(targets)
    for bound in reversed([*stages.values()]):  # each before its inputs
        if bound in included:
            included.update(bound.inputs)
    return {name: bound for name, bound in stages.items() if bound in included}


def modules_of(stages: Iterable[BoundStage]) -> list[str]:
    """Return the names of the modules that define some stages."""
    return sorted({module_and_name(bound.stage.function)[0] for bound in stages})


class Plan:
    """Plan of a sweep: stages, cells and keys."""

    def __init__(self, experiment: Experiment, choices: Choices) -> None:
        self.experiment = experiment
        self.choices = choices
        self.axes = make_axes(experiment.declared, choices)
        self._axis_of = {
            setting.key: (number, position)
            for number, axis in enumerate(self.axes)
            for position, setting in enumerate(axis.settings)
        }
        self._all_stages = bind(experiment, choices.zipped)
        self.targets = stored_stages(self._all_stages.values(), choices)
        self.bound = with_inputs(self.targets, self._all_stages)
        self._strides = {bound: self._axis_strides(bound) for bound in self.bound.values()}
        self.along_strides = {bound: self._along_strides(bound) for bound in self.bound.values()}
        # Filled on demand.
        self._input_cells: dict[BoundStage, dict[BoundStage, InputCells]] = {}
        self._keys: dict[BoundStage, Keys] = {}
        self._fingerprints: dict[BoundStage, str] = {}
        self._derived_values: dict[BoundStage, NDArray[np.object_]] = {}  # by number of the cell
        self._check_size()
        for bound in self.bound.values():
            self._check_zipped(bound)
            if bound.stage.substitutions:
                self.input_cells(bound)  # may refuse the substitutions

    def unused_settings(self, keys: Iterable[str]) -> list[str]:
        """Return the keys that stages of the experiment read, but no stage of this plan."""
        used_keys, all_keys = (
            _setting_keys(self.bound.values()),
            _setting_keys(self._all_stages.values()),
        )
        recorder = Choices(self.choices.values, self.choices.zipped)
        for group in {bound.stage.group for bound in self._all_stages.values()}:
            group.when(recorder)
        used_keys |= recorder.read_keys
        used_keys |= {
            setting.fallback.key
            for setting in self.experiment.declared
            if setting.key in used_keys and setting.fallback is not None
        }
        return sorted(key for key in keys if key in all_keys and key not in used_keys)

    # axes -----------------------------------------------------------------------------------

    @property
    def axis_lengths(self) -> dict[str, int]:
        """Return the length of every swept axis that a stage depends on."""
        used_axes = {self.axis_number(key) for key in _setting_keys(self.bound.values())}
        return {
            "+".join(setting.key for setting in axis.settings): len(axis.points)
            for number, axis in enumerate(self.axes)
            if axis.is_swept and number in used_axes
        }

    @property
    def varied_settings(self) -> list[Setting]:
        """Return the swept settings that stages read and whose values are not their defaults.

        Settings that the command line names come first; draws are left out.
        """
        used_keys = _setting_keys(self.bound.values())
        settings = [
            setting
            for setting in self.experiment.experiment_settings
            if setting.key in used_keys and self._is_varied(setting)
        ]
        return sorted(settings, key=lambda setting: setting.key not in self.choices.given_keys)

    def _is_varied(self, setting: Setting) -> bool:
        values = self.choices[setting]
        if len(values) < 2 or isinstance(setting.kind, Draws):
            return False
        if setting.fallback is not None:
            return values != self.choices[setting.fallback]
        return setting.default is None or values != setting.values(setting.default)

    def axis_number(self, key: str) -> int:
        """Return the number of a setting's axis."""
        return self._axis_of[key][0]

    def axis_numbers(self, bound: BoundStage) -> tuple[int, ...]:
        """Return the numbers of the swept axes that a stage depends on, ascending."""
        return tuple(self._strides[bound])

    def _along_strides(self, bound: BoundStage) -> dict[int, int]:
        """Return the strides of the axes that a stage computes together, by number."""
        return {
            number: stride
            for number, stride in self._strides[bound].items()
            if len(self.axes[number].settings) == 1
            and self.axes[number].settings[0].key in bound.along
        }

    def _axis_strides(self, bound: BoundStage) -> dict[int, int]:
        """Return the stride of a stage's cells along each swept axis."""
        numbers = sorted({self.axis_number(key) for key in bound.needs})
        swept = [number for number in numbers if self.axes[number].is_swept]
        lengths = [len(self.axes[number].points) for number in swept]
        return {number: prod(lengths[position + 1 :]) for position, number in enumerate(swept)}

    def _check_size(self) -> None:
        """Refuse too many cells."""
        cells = sum(self.count(bound) for bound in self.bound.values())
        if cells > MAX_CELLS:
            listed = ", ".join(f"{key} ({count:,})" for key, count in self.axis_lengths.items())
            raise ConfigurationError(
                f"the sweep has {cells:,} cells, but may have at most {MAX_CELLS:,}; "
                f"numbers of values: {listed}"
            )

    def _check_zipped(self, bound: BoundStage) -> None:
        """Refuse gathered settings that run together with others."""
        for axis in (self.axes[self.axis_number(key)] for key in bound.gather):
            if axis.is_swept and axis.is_zipped and not bound.stage.is_derived:
                raise ConfigurationError(
                    f"{axis.settings[0].key} cannot be zipped with other settings: stage "
                    f"{bound.name} gathers all its values"
                )

    # cells ----------------------------------------------------------------------------------

    def count(self, bound: BoundStage) -> int:
        """Return the number of cells of a stage."""
        return prod(len(self.axes[number].points) for number in self._strides[bound])

    def cells(self, bound: BoundStage) -> Cells:
        """Return the numbers of all cells of a stage."""
        return np.arange(self.count(bound))

    def positions(self, bound: BoundStage, number: int, cells: Cells | int) -> Any:
        """Return the positions of cells on an axis; 0 if their stage does not depend on it."""
        stride = self._strides[bound].get(number)
        return 0 * cells if stride is None else cells // stride % len(self.axes[number].points)

    def first_cells(self, bound: BoundStage, cells: Cells) -> Cells:
        """Map each cell to the first position of every axis that its stage computes together."""
        for number, stride in self.along_strides[bound].items():
            cells = cells - stride * self.positions(bound, number, cells)
        return cells

    def value(self, bound: BoundStage, key: str, cell: int) -> Value:
        """Return the value of a setting in a cell of a stage."""
        number, position = self._axis_of[key]
        return self.axes[number].points[self.positions(bound, number, cell)][position]

    def cell_name(self, bound: BoundStage, cell: int) -> str:
        """Return the name of a cell: its stage, and name=value for every swept axis."""
        words = [bound.name]
        for number in self._strides[bound]:
            axis, position = self.axes[number], self.positions(bound, number, cell)
            if axis.unlabelled:
                pairs = zip(axis.settings, axis.points[position], strict=True)
                used_pairs = [
                    (setting.name, value) for setting, value in pairs if setting.key in bound.needs
                ]
                words += [f"{name}={format_value(value)}" for name, value in used_pairs]
                continue
            label = (
                axis.labels[position]
                if axis.labels
                else ",".join(map(format_value, axis.points[position]))
            )
            words.append(f"{axis.name}={label}")
        return " ".join(words)

    # inputs ---------------------------------------------------------------------------------

    def input_cells(self, bound: BoundStage) -> dict[BoundStage, InputCells]:
        """Return, by input, the input cells that the cells of a stage read."""
        if bound not in self._input_cells:
            sources = dict.fromkeys(bound.inputs)
            find = partial(self._find_input_cells, bound)
            self._input_cells[bound] = {source: find(source) for source in sources}
        return self._input_cells[bound]

    def computed_inputs(self, bound: BoundStage) -> list[InputCells]:
        """Return the input cells of every input that is not a derived stage."""
        return [
            inputs
            for inputs in self.input_cells(bound).values()
            if not inputs.source.stage.is_derived
        ]

    def _find_input_cells(self, bound: BoundStage, source: BoundStage) -> InputCells:
        cells, strides = self.cells(bound), self._strides[source]
        substituted = {
            self.axis_number(target.key): self._substitute(bound, source, target, replacement)
            for target, replacement in bound.stage.substitutions.items()
            if target.key in source.needs
        }
        first = 0 * cells
        for number, stride in strides.items():
            positions = (
                substituted[number]
                if number in substituted
                else self.positions(bound, number, cells)
            )
            first += stride * positions
        offsets = np.zeros((), dtype=np.int64)
        for number in (self.axis_number(key) for key in bound.gather if key in source.needs):
            positions = np.arange(len(self.axes[number].points))
            offsets = offsets[..., None] + strides.get(number, 0) * positions
        return InputCells(source, first, offsets)

    def _substitute(
        self, bound: BoundStage, source: BoundStage, target: Setting, replacement: Setting
    ) -> Cells:
        """Return, by cell, the position of an input on the axis of `target`.

        The input is read where `target` equals the cell's value of `replacement`.

        Raises
        ------
        ConfigurationError
            If the axis lacks a value, or settings that run together make it ambiguous.
        """
        number, position = self._axis_of[target.key]
        axis, (other_number, other_position) = self.axes[number], self._axis_of[replacement.key]
        used_members = [k for k, member in enumerate(axis.settings) if member.key in source.needs]
        depends, cells = number in self._strides[bound], self.cells(bound)
        length = len(axis.points)
        pairs = self.positions(bound, other_number, cells) * length + self.positions(
            bound, number, cells
        )
        distinct, inverse = np.unique(pairs, return_inverse=True)
        positions = []
        for pair in distinct.tolist():
            replacement_position, target_position = divmod(pair, length)
            value = self.axes[other_number].points[replacement_position][other_position]
            matching = [k for k, point in enumerate(axis.points) if point[position] == value]
            candidates = {tuple(axis.points[k][r] for r in used_members) for k in matching}
            if depends and target_position in matching:
                positions.append(target_position)
            elif len(candidates) == 1 and not (depends and len(used_members) > 1):
                positions.append(matching[0])
            else:
                raise ConfigurationError(
                    f"{replacement.key} has {format_value(value)}, but must be a value of "
                    f"{target.key}, which must not run together with other settings, because "
                    f"{bound.name} takes {source.name} there"
                )
        return np.array(positions)[inverse]

    def argument_value(self, bound: BoundStage, source: Setting | BoundStage, cell: int) -> Value:
        """Return the value of an argument that is a setting or a derived stage."""
        if isinstance(source, Setting):
            gathered = source.key in bound.gather
            value = self.choices[source] if gathered else self.value(bound, source.key, cell)
            return source.in_si(value)
        input_cell = int(self.input_cells(bound)[source].first[cell])
        if source not in self._derived_values:
            self._derived_values[source] = np.full(self.count(source), NOT_CALLED, dtype=object)
        results = self._derived_values[source]
        if results[input_cell] is NOT_CALLED:
            results[input_cell] = self._call_derived(source, input_cell)
        return results[input_cell]

    def _call_derived(self, bound: BoundStage, cell: int) -> Value:
        """Return the result of a derived stage in one of its cells."""
        arguments = bound.arguments.items()
        values = {name: self.argument_value(bound, source, cell) for name, source in arguments}
        try:
            return bound.stage.check_value(bound.stage.function(**values))
        except (ConfigurationError, DeclarationError):
            raise
        except RAISED as error:
            words = ", ".join(f"{name}={format_value(value)}" for name, value in values.items())
            raise ConfigurationError(
                f"{bound.name} cannot be computed from {words}: {error or type(error).__name__}"
            ) from error

    def factorise(
        self, bound: BoundStage, source: Setting | BoundStage, cells: Cells
    ) -> tuple[tuple[Value, ...], Cells]:
        """Return the distinct values of an argument over cells, and each cell's index into them.

        The argument is a setting or a derived stage.
        """
        if isinstance(source, Setting) and source.key not in bound.gather:
            values, codes = self._factorise_setting(bound, source, cells)
            return tuple(map(source.in_si, values)), codes
        if isinstance(source, Setting):
            codes, size = 0 * cells, 1
        else:
            codes, size = self.input_cells(bound)[source].first[cells], self.count(source)
        return _values_by_position(codes, size, cells, partial(self.argument_value, bound, source))

    def _factorise_setting(
        self, bound: BoundStage, setting: Setting, cells: Cells
    ) -> tuple[tuple[Value, ...], Cells]:
        """Return the distinct values of a setting over cells, and each cell's index into them."""
        number = self.axis_number(setting.key)
        codes, size = self.positions(bound, number, cells), len(self.axes[number].points)
        return _values_by_position(codes, size, cells, partial(self.value, bound, setting.key))

    def stream(self, bound: BoundStage, cell: int) -> tuple[int, dict[str, Any]]:
        """Return the arguments of `cell_rng` for a cell: the seed, and the name of its stream."""
        name: dict[str, Any] = {"stage": self._stream_name(bound)}
        for label, setting, optional in self._stream_settings(bound):
            value = self.value(bound, setting.key, cell)
            if value or not optional:
                name[label] = value
        return self.value(bound, Run.seed.key, cell), name

    def _stream_name(self, bound: BoundStage) -> str:
        return (bound.stage.stream and bound.stage.stream.name) or bound.name

    def _stream_settings(self, bound: BoundStage) -> list[tuple[str, Setting, bool]]:
        """Return label, setting and optionality of the settings that name a stream.

        A label is the setting's name, or its key if the stage declares no `Stream`. If the label
        is reserved or not unique, it is `setting KEY` instead, which is always unique.
        """
        stream, by_key = bound.stage.stream, self.experiment.by_key
        if stream is None:
            keys = [key for key in bound.needs if key != Run.seed.key]
            named = [(key, by_key[key], False) for key in keys]
        else:
            sources = ((stream.settings, False), (stream.optional, True))
            named = [
                (setting.name, setting, optional)
                for settings, optional in sources
                for setting in settings
            ]
        counts = Counter([*STREAM_WORDS, *(label for label, *_ in named)])
        return [
            (label if counts[label] == 1 else f"setting {setting.key}", setting, optional)
            for label, setting, optional in named
        ]

    # keys -----------------------------------------------------------------------------------

    def key(self, bound: BoundStage, cell: int) -> str:
        """Return the key of one cell as text; see `keys`."""
        return key_text(self.keys(bound)[cell])

    def keys(self, bound: BoundStage) -> Keys:
        """Return the keys of all cells of a stage, (cell, 2): hashes of all their dependencies.

        Keys of inputs are computed first, and no key twice.
        """
        if bound not in self._keys:
            keys = np.empty((self.count(bound), 2), np.uint64)
            for start in range(0, len(keys), HASHED_CELLS):
                cells = np.arange(start, min(start + HASHED_CELLS, len(keys)))
                keys[start : start + HASHED_CELLS] = self.hash_cells(bound, cells, self.keys)
            self._keys[bound] = keys
        return self._keys[bound]

    def drop_keys(self, bound: BoundStage) -> None:
        """Free the memory of a stage's keys; `keys` computes them again."""
        self._keys.pop(bound, None)

    def hash_cells(
        self, bound: BoundStage, cells: Cells, known: Callable[[BoundStage], Keys]
    ) -> Keys:
        """Return the keys of cells from the keys of their inputs, which `known` returns."""
        identity = f"{STREAM_VERSION} {self.identity[bound.name]}"
        keys = np.tile(hash_texts([identity]), (len(cells), 1))
        for name, source in bound.arguments.items():
            if isinstance(source, Setting) or source.stage.is_derived:
                values, codes = self.factorise(bound, source, cells)
                texts = [f"{name}={value_token(value)}" for value in values]
                fold(keys, hash_texts(texts)[codes])
            else:
                inputs = self.input_cells(bound)[source]
                first, codes = np.unique(inputs.first[cells], return_inverse=True)
                gathered = (first[:, None] + inputs.offsets.ravel()).ravel()
                rows = known(source)[gathered].reshape(len(first), inputs.offsets.size, 2)
                gathers = rows.shape[1] > 1
                words = hash_texts(row.tobytes() for row in rows) if gathers else rows[:, 0]
                fold(keys, hash_texts([f"{name}:"]))
                fold(keys, words[codes])
        if bound.random:
            versions = (np.__version__, self._stream_name(bound))
            fold(keys, hash_texts([repr(versions)]))
            settings = [("", Run.seed, False), *self._stream_settings(bound)]
            for label, setting, optional in settings:
                values, codes = self._factorise_setting(bound, setting, cells)
                counted_values = (value for value in values if value or not optional)
                tokens = {value: f"{label}~{value_token(value)}" for value in counted_values}
                fold(keys, hash_texts(tokens.get(value, "") for value in values)[codes])
        return keys

    def fingerprint(self, bound: BoundStage) -> str:
        """Return the hash of the keys of all cells of a stage, as text."""
        if bound not in self._fingerprints:
            self._fingerprints[bound] = key_text(hash_texts([self.keys(bound).data])[0])
        return self._fingerprints[bound]

    @cached_property
    def identity(self) -> dict[str, str]:
        """Return by stage the hash of its code, its outputs and the order of its axes."""
        identities = {}
        for name, bound in self.bound.items():
            outputs = [output.identity for output in bound.stage.outputs]
            order = (bound.along, bound.gather)  # of the axes of arguments and results
            identities[name] = digest(repr([outputs, order, self.digests[name].digest]))
        return identities

    @cached_property
    def source_code(self) -> Code:
        """Return the code of the experiment's packages and of the files of its stages."""
        homes = {module_and_name(stage.function)[0] for stage in self.experiment.stages}
        return Code(frozenset(self.experiment.code), frozenset(homes))

    @cached_property
    def digests(self) -> dict[str, CodeDigest]:
        """Return the digest of each stage's function."""
        stages = {name: bound.stage for name, bound in self.bound.items()}
        digest = self.source_code.digest
        digests = {name: digest(stage.function, stage.version) for name, stage in stages.items()}
        save_parsed_modules()
        return digests

    @property
    def code(self) -> dict[str, str]:
        """Return by stage the hash of its code and libraries, for the store's attributes."""
        return {name: code.digest for name, code in self.digests.items()}


def _values_by_position(
    codes: Cells, size: int, cells: Cells, value: Callable[[int], Value]
) -> tuple[tuple[Value, ...], Cells]:
    """Return the values at distinct positions, and each cell's index into them.

    `codes` are the positions of `cells`, all below `size`. Call `value` with one cell of each
    distinct position.
    """
    is_used, representative = np.zeros(size, dtype=bool), np.zeros(size, dtype=np.int64)
    is_used[codes], representative[codes] = True, cells
    return tuple(map(value, representative[is_used].tolist())), (np.cumsum(is_used) - 1)[codes]


def _setting_keys(stages: Iterable[BoundStage]) -> set[str]:
    """Return keys of the settings that some stages depend on."""
    return {key for bound in stages for key in (*bound.needs, *bound.gather)}
