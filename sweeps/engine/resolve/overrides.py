"""Compose the overrides of a command line with Hydra, check and expand them, and fuse jobs.

Jobs with the same store form one sweep, in which settings that differ between them become axes.
Each setting that the jobs cross becomes a separate axis. Settings that change together, such as the
settings of a group's choices (`spring=soft,hard`), are zipped along one axis named after the group.
"""

from __future__ import annotations

import difflib
import math
import os
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice, product
from pathlib import Path
from typing import Any, ClassVar

import hydra
from hydra.core.config_loader import ConfigLoader
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override, RangeSweep, Sweep, Transformer
from hydra.core.plugins import Plugins
from hydra.errors import HydraException
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.kinds import MAX_VALUES, Value, format_value, quote_value, sort_key
from sweeps.engine.declare.paths import PathOrUrl, path_or_url
from sweeps.engine.declare.settings import (
    CLUSTERS,
    Choices,
    Run,
    Setting,
    Zip,
    ZippedAxis,
    flatten,
    nested,
    read_choices,
)
from sweeps.engine.declare.stage import Experiment

SCHEMA = "sweep_schema"
LIST_OVER_MAPPING = "Cannot merge DictConfig with ListConfig"  # a message of OmegaConf
WORD = r"[^\[\]{},:\s](?:[^\[\]{},:]*[^\[\]{},:\s])?"  # of a list or mapping
SIMILARITY = 0.66  # least similarity of a suggested key


# composing ----------------------------------------------------------------------------------------


def config_name(experiment: Experiment) -> str:
    """Return the name of the primary configuration of Hydra."""
    return "config" if experiment.conf is not None else "all_defaults"


class AddedFolders(SearchPathPlugin):
    """Plug-in by which Hydra finds the folders that other packages add to an experiment."""

    folders: ClassVar[tuple[Path, ...]] = ()

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """Append the folders."""
        for folder in self.folders:
            search_path.append(provider=folder.parent.name, path=f"file://{folder}")


def register(experiment: Experiment) -> None:
    """Register the schema of an experiment and its default configuration with Hydra."""
    config_store = ConfigStore.instance()
    config_store.store(name=SCHEMA, node=_build_schema(nested(experiment.by_key)))
    for kind in CLUSTERS:
        config_store.store(group="cluster", name=kind, node={"kind": kind})
    AddedFolders.folders = experiment.added_conf
    Plugins.instance().register(AddedFolders)
    if experiment.conf is None:
        base = [SCHEMA, {"cluster": "local"}, "_self_"]
        node = {"defaults": base, "hydra": {"job": {"name": experiment.name}}}
        config_store.store(name=config_name(experiment), node=node)


def _build_schema(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return the defaults of a group; values have any type, since settings check their values."""
    return {
        key: _build_schema(inner) if (inner := members(entry)) else entry and entry.default_input
        for key, entry in tree.items()
    }


def members(entry: Mapping[str, Any] | Setting | None) -> Mapping[str, Any]:
    """Return members of a group, or of a setting whose values are written as a mapping."""
    if isinstance(entry, Setting):
        return dict.fromkeys(entry.kind.fields)
    return entry or {}


@contextmanager
def hydra_context(experiment: Experiment) -> Iterator[None]:
    """Let Hydra find the configuration of an experiment within this context."""
    register(experiment)
    if experiment.conf is None:
        with hydra.initialize(version_base="1.3", config_path=None):
            yield
    else:
        with hydra.initialize_config_dir(str(experiment.conf), version_base="1.3"):
            yield


def compose(experiment: Experiment, overrides: Sequence[str]) -> DictConfig:
    """Return the configuration of some overrides."""
    arguments = clear_before_set(experiment, overrides)
    try:
        try:
            return hydra.compose(config_name(experiment), overrides=arguments)
        except HydraException as error:
            if LIST_OVER_MAPPING not in str(error):
                raise
            return _compose_lists(experiment, arguments)
    except (HydraException, OmegaConfBaseException, TypeError, ValueError) as error:
        raise ConfigurationError(f"{error_message(error)} (of {' '.join(overrides)})") from error


def _compose_lists(experiment: Experiment, overrides: list[str]) -> DictConfig:
    """Compose a configuration in which a file replaces start, stop and step by a list.

    OmegaConf cannot merge the two, so compose without defaults in steps, and set them afterwards
    where no file has a value.
    """
    config_store, schema = ConfigStore.instance(), _build_schema(nested(experiment.by_key))
    steps = [
        setting for setting in experiment.declared if isinstance(setting.default_input, Mapping)
    ]
    without = OmegaConf.create(schema)
    for setting in steps:
        OmegaConf.update(without, setting.key, None, merge=False)
    config_store.store(name=SCHEMA, node=OmegaConf.to_container(without))
    try:
        config = hydra.compose(config_name(experiment), overrides=overrides)
    finally:
        config_store.store(name=SCHEMA, node=schema)
    for setting in steps:
        if OmegaConf.select(config, setting.key) is None:
            OmegaConf.update(config, setting.key, setting.default_input, merge=False)
    return config


def clear_before_set(experiment: Experiment, overrides: Sequence[str]) -> list[str]:
    """Return overrides that clear a setting before they set it.

    OmegaConf merges mappings, and refuses to replace a mapping by a list or a list by a mapping, so
    a setting is emptied before it is set: `spring.mass=[0,45]` becomes
    `++spring.mass=null spring.mass=[0,45]` (with `++`, since a multirun keeps one override of
    each spelling).
    """
    keys = {setting.key for setting in experiment.declared if not members(setting)}
    lines = []
    for override in overrides:
        stripped = override.lstrip("+")  # a setting is always there, so nothing is added
        key = stripped.partition("=")[0]
        lines += [f"++{key}=null", stripped] if key in keys else [override]
    return lines


def error_message(error: BaseException | None) -> str:
    """Return the messages of an error and its causes in one line."""
    words = []
    while error is not None:
        if isinstance(error, OmegaConfBaseException):  # other lines of its message name its classes
            words += [f"{error.full_key}:", *str(error).partition("\n")[0].split()]
        else:
            words += str(error).split()
        error = error.__cause__
    return " ".join(words)


# choices ------------------------------------------------------------------------------------------


def read_configuration(experiment: Experiment, config: DictConfig) -> Choices:
    """Return the choices of a composed configuration, after checking each setting.

    Raises
    ------
    ConfigurationError
        Naming the first invalid key, its value and the allowed values.
    """
    raw: Any = OmegaConf.to_container(config, resolve=False)
    _check_tree(experiment, nested(experiment.by_key), raw, "")
    try:
        values: Any = OmegaConf.to_container(config, resolve=True)
    except OmegaConfBaseException as error:
        key = (error.full_key or "").partition("[")[0]
        inputs = flatten(experiment.declared, raw)
        reason = str(error).partition("\n")[0]
        raise ConfigurationError(
            f"{key} is {inputs.get(key)}, but must refer to keys that have a value ({reason})"
        ) from error
    inputs = flatten(experiment.declared, values)
    (groups,) = Zip.zip.values(inputs.get(Zip.zip.key))
    zipped_settings = [[_find_setting(experiment, name) for name in names] for names in groups]
    zipped = [_make_zipped_axis(settings, inputs) for settings in zipped_settings]
    zipped_keys = [key for axis in zipped for key in axis.keys]
    if repeated := [key for key in zipped_keys if zipped_keys.count(key) > 1]:
        raise ConfigurationError(
            f"grid.zip has {repeated[0]!r} more than once, but keys must differ"
        )
    for key in zipped_keys:  # a setting may repeat values on a zipped axis
        if isinstance(listed := inputs.get(key), list):
            inputs[key] = [
                value for position, value in enumerate(listed) if value not in listed[:position]
            ]
    choices = read_choices(experiment.declared, inputs)
    return Choices(choices.values, (*choices.zipped, *zipped))


def _check_tree(experiment: Experiment, tree: Mapping[str, Any], node: Any, parent: str) -> None:
    """Refuse unknown keys of a configuration; Hydra itself accepts `+key=value`."""
    if not isinstance(node, Mapping):
        raise not_a_group_error(tree, parent, node)
    for name in map(str, node):
        key = f"{parent}.{name}".lstrip(".")
        if name not in tree:
            raise unknown_key_error(experiment, tree, parent, key)
        if isinstance(tree[name], Mapping):
            _check_tree(experiment, tree[name], node[name], key)


def not_a_group_error(tree: Mapping[str, Any], key: str, value: Any) -> ConfigurationError:
    """Return the error of a group that was set to a value."""
    return ConfigurationError(f"{key} is {quote_value(value)}, but must hold {', '.join(tree)}")


def unknown_key_error(
    experiment: Experiment, tree: Mapping[str, Any], group: str, key: str
) -> ConfigurationError:
    """Return the error of a key that is not in its group, which has the keys of `tree`."""
    word = key.rpartition(".")[2]
    problem = f"{key} is not a key of the configuration"
    candidates = [
        setting.key for setting in experiment.declared if setting.key.endswith(f".{word}")
    ]
    suggestions = difflib.get_close_matches(key, candidates, n=1, cutoff=SIMILARITY) or candidates
    if not suggestions:
        similar = difflib.get_close_matches(word, tree, n=1, cutoff=SIMILARITY)
        suggestions = [f"{group}.{name}".lstrip(".") for name in similar]
    if suggestions:
        return ConfigurationError(f"{problem}; did you mean {' or '.join(suggestions)}?")
    return ConfigurationError(f"{problem}; {group or 'it'} has {', '.join(tree) or 'no keys'}")


# settings that run together -----------------------------------------------------------------------


def _make_zipped_axis(settings: Sequence[Setting], inputs: Mapping[str, Any]) -> ZippedAxis:
    """Return the zipped axis of settings that run together."""
    keys = [setting.key for setting in settings]
    pairs = ((setting, inputs.get(setting.key, setting.default_input)) for setting in settings)
    listed = [_values_in_given_order(*pair) for pair in pairs]
    if len(set(map(len, listed))) > 1:
        counts = (f"{key} has {len(values)}" for key, values in zip(keys, listed, strict=True))
        raise ConfigurationError(
            f"grid.zip has {', '.join(keys)}, which must have the same number of values, but "
            f"{', '.join(counts)}"
        )
    points = sorted(
        zip(*listed, strict=True), key=lambda point: [sort_key(value) for value in point]
    )
    if len(set(points)) < len(points):
        problem = f"grid.zip has {', '.join(keys)}"
        raise ConfigurationError(f"{problem}, which repeat a combination of values")
    return ZippedAxis("_".join(setting.name for setting in settings), tuple(keys), tuple(points))


def _values_in_given_order(setting: Setting, value: Any) -> list[Any]:
    """Return values in the order of the override."""
    if isinstance(value, list | tuple):
        return [setting.values(entry)[0] for entry in value]
    return list(setting.values(value))


def _find_setting(experiment: Experiment, name: str) -> Setting:
    """Return the setting of a key, or of the last word of a key."""
    exact = experiment.by_key.get(name) or experiment.by_key.get(f"{Zip.key}.{name}")
    settings = experiment.declared
    matches = [exact] if exact else [setting for setting in settings if setting.name == name]
    if len(matches) != 1:
        keys = ", ".join(setting.key for setting in matches)
        hint = f"several keys: {keys}" if matches else "not a setting"
        raise ConfigurationError(f"grid.zip has {name!r}, which is {hint}; give a whole key")
    if matches[0].not_swept:
        raise ConfigurationError(
            f"grid.zip has {name!r}, but it takes one value: {matches[0].not_swept}"
        )
    return matches[0]


DEFAULT_STORE = "sweep.zarr"
STEPS = ("start", "stop", "step")  # keys of a setting whose values are in steps
MAX_JOBS = 1_000  # each is composed by itself; more values of a setting are an axis


@dataclass(frozen=True)
class Job:
    """One job of a command line: its overrides by key, its choices, and the path of its store."""

    overrides: dict[str, str]
    choices: Choices
    store: str


def read_jobs(experiment: Experiment, arguments: Sequence[str], *, several: bool) -> list[Job]:
    """Return the jobs of a command line, after checking each setting separately.

    With `several`, each swept value makes a job, unless the values make an axis.

    Raises
    ------
    ConfigurationError
        Naming the first invalid key, its value and the allowed values.
    """
    with hydra_context(experiment):
        overrides = _parse_overrides(experiment, arguments, several=several)
        return [
            make_job(experiment, compose(experiment, lines), lines, DEFAULT_STORE)
            for lines in _expand_jobs(experiment, overrides)
        ]


def make_job(
    experiment: Experiment, configuration: DictConfig, lines: Iterable[str], store: str
) -> Job:
    """Return a job of a composed configuration; `store` is its path if that names none."""
    by_key = dict(line.partition("=")[::2] for line in lines)
    choices = replace(read_configuration(experiment, configuration), given_keys=tuple(by_key))
    return Job(by_key, choices, choices.value(Run.store) or store)


# checks -------------------------------------------------------------------------------------------


def _parse_overrides(
    experiment: Experiment, arguments: Sequence[str], *, several: bool
) -> list[Override]:
    """Parse arguments into overrides; refuse unknown keys and unknown choices of groups."""
    loader = GlobalHydra.instance().config_loader()
    parser = OverridesParser.create(loader)
    overrides = []
    for number, argument in enumerate(arguments):
        key, _, value = argument.partition("=")
        if not key.lstrip("+~"):
            raise ConfigurationError(f"{argument} has no key, but must be KEY=VALUE")
        override = _try_parse(parser, argument)
        if override is None:
            raise _syntax_error(experiment, parser, arguments[number:])
        parsed: Any = override.value()
        parts = parsed if isinstance(parsed, list) else [parsed]
        swept = [part for part in parts if isinstance(part, Sweep)]
        if swept and (isinstance(parsed, list) or not several):
            hints = []
            if isinstance(swept[0], RangeSweep):
                hints = [f"give steps, {quote_for_shell(f'{key}={_format_steps(swept[0])}')}"]
            elif isinstance(parsed, ChoiceSweep) and parsed.simple_form:
                text = quote_for_shell(f"{key}={_quote_for_hydra(value)}")
                hints = [f"quote it, {quote_for_shell(f'{key}=[{value}]')}, or as a text, {text}"]
            hints += [f"or sweep over it, -m {quote_for_shell(argument)}"] * (swept == [parsed])
            hint = ": " * bool(hints) + "; ".join(hints)
            raise ConfigurationError(f"{key} is {value}, but must be one value or a list{hint}")
        _check_key(experiment, loader, override)
        overrides.append(override)
    return overrides


def _format_steps(swept: RangeSweep) -> str:
    """Format a range of Hydra, which excludes its stop, as start, stop and step."""
    values: list[Any] = [*islice(swept.range(), MAX_VALUES)] or [swept.start]
    return format_value({"start": min(values), "stop": max(values), "step": abs(swept.step)})


def quote_for_shell(text: str) -> str:
    """Quote a word for a shell, if it needs quotes."""
    can_double_quote = "'" in text and not set(text) & set('$`"!\\')
    return f'"{text}"' if can_double_quote else shlex.quote(text)


def _quote_for_hydra(text: str) -> str:
    """Quote a text for Hydra."""
    mark = '"' if "'" in text and '"' not in text else "'"
    # Hydra halves backslashes before such a mark, also before the closing one.
    text = re.sub(rf"(\\*){mark}", rf"\1\1\\{mark}", text)
    return mark + re.sub(r"(\\+)\Z", r"\1\1", text) + mark


def _try_parse(parser: OverridesParser, argument: str) -> Override | None:
    """Return the override of an argument; None if Hydra cannot read it."""
    try:
        return parser.parse_overrides([argument])[0]
    except (HydraException, TypeError, ValueError):
        return None


def _syntax_error(
    experiment: Experiment, parser: OverridesParser, arguments: Sequence[str]
) -> ConfigurationError:
    """Return the error of the first argument, which Hydra cannot parse.

    The next arguments may belong to it, since the shell splits at spaces.
    """
    candidates = (" ".join(arguments[:end]) for end in range(1, len(arguments) + 1))
    pairs = (("[", "]"), ("{", "}"))
    closed = (text for text in candidates if all(text.count(a) == text.count(b) for a, b in pairs))
    argument = next(closed, arguments[0])
    key, equals, value = argument.partition("=")
    if not equals:
        return ConfigurationError(f"{argument} has no value, but must be KEY=VALUE")
    if _try_parse(parser, f"{key}=1") is None:
        return unknown_key_error(experiment, nested(experiment.by_key), "", key)

    def quote_word(word: re.Match[str]) -> str:
        return word[0] if _try_parse(parser, f"x={word[0]}") else _quote_for_hydra(word[0])

    if _try_parse(parser, argument) is None:
        listed = value.startswith(("[", "{"))
        argument = f"{key}={re.sub(WORD, quote_word, value) if listed else _quote_for_hydra(value)}"
    override, setting = _try_parse(parser, argument), experiment.by_key.get(key.lstrip("+"))
    if override is None:
        return ConfigurationError(f"{arguments[0]} cannot be read, but must be KEY=VALUE")
    try:
        if setting is not None:
            setting.values(override.value())
    except ConfigurationError as error:
        return error
    return ConfigurationError(
        f"{arguments[0]} cannot be read: quote it, {quote_for_shell(argument)}"
    )


def _check_key(experiment: Experiment, loader: ConfigLoader, override: Override) -> None:
    """Refuse a key that is not in the configuration, or a value that a group does not have."""
    key = override.key_or_group
    value: Any = override.value()
    # Hydra copies its whole configuration to look for a group.
    if key not in experiment.by_key and (options := loader.get_group_options(key)):
        for choice in override.sweep_iterator() if override.is_sweep_override() else [value]:
            if isinstance(choice, list):
                hint = f"; {key}.name takes a list" if f"{key}.name" in experiment.by_key else ""
                text = str(override.input_line).partition("=")[2]
                raise ConfigurationError(f"{key} is {text}, but must be one choice{hint}")
            if choice is not None and choice not in options:
                listed = ", ".join(options)
                raise ConfigurationError(f"{key} is {choice!r}, but must be one of {listed}")
        return
    tree: Mapping[str, Any] = nested(experiment.by_key)
    words = key.split(".")
    for depth, word in enumerate(words):
        if word not in tree:
            raise unknown_key_error(experiment, tree, ".".join(words[:depth]), key)
        is_last = depth == len(words) - 1
        tree = members(tree[word]) or ({} if is_last else dict.fromkeys(STEPS))
    if tree and not override.is_delete() and not isinstance(value, dict):
        raise not_a_group_error(tree, key, value)


# jobs ---------------------------------------------------------------------------------------------


def _expand_jobs(
    experiment: Experiment, overrides: Sequence[Override]
) -> Iterator[tuple[str, ...]]:
    """Return the overrides of every job.

    Make swept settings axes of one job, `a=[1,2]` for `a=1,2`, so that a grid of thousands of
    points is one job. Make a job for each value of a group, of a setting that takes one value, and
    of a key that another override refers to, such as the store's path.

    Raises
    ------
    ConfigurationError
        If an axis has too many values, or there are too many jobs.
    """
    lines = [str(override.input_line) for override in overrides]
    axes = {setting.key for setting in experiment.declared if not setting.not_swept}
    options: dict[str, list[str]] = {}  # the last override of a key counts
    for override, line in zip(overrides, lines, strict=True):
        key, name = override.get_key_element(), override.key_or_group
        options[key] = [line]
        if not override.is_sweep_override():
            continue
        values = _swept_values(override, MAX_VALUES)
        refers = any(f"{{{name}}}" in other for other in lines)
        listed = any(value.startswith(("[", "{")) for value in values)
        if name in axes and not refers and not listed:
            options[key] = [f"{key}=[{','.join(values)}]"]
        else:
            options[key] = [f"{key}={value}" for value in values]
    if math.prod(map(len, options.values())) > MAX_JOBS:
        longest = max(options, key=lambda key: len(options[key]))
        raise ConfigurationError(
            f"{longest} has {len(options[longest]):,} values, each of which makes jobs, but there "
            f"may be at most {MAX_JOBS:,} jobs"
        )
    return product(*options.values())


def _swept_values(override: Override, limit: int) -> list[str]:
    """Return the values of a swept override as text; refuse too many before making them."""
    values = override.sweep_iterator(transformer=Transformer.encode)
    texts = [str(value) for value in islice(values, limit + 1)]
    if len(texts) > limit:
        raise ConfigurationError(f"{override.input_line} has more than {limit:,} values")
    return texts


# jobs as one sweep --------------------------------------------------------------------------------


Point = tuple[Value, ...]
SEPARATE = "put it into the store's path for separate stores"


def fuse_jobs(experiment: Experiment, jobs: Sequence[Job]) -> list[tuple[Choices, PathOrUrl]]:
    """Fuse jobs of one store into one sweep; return the choices and store of each sweep.

    Raises
    ------
    ConfigurationError
        If jobs of one store differ in a setting that takes one value.
    """
    by_store: dict[PathOrUrl, list[Job]] = {}
    for job in jobs:
        store = path_or_url("store", job.store)
        if isinstance(store, Path):
            store = Path(os.path.abspath(store))
        by_store.setdefault(store, []).append(job)
    return [(_fuse_group(experiment, group), store) for store, group in by_store.items()]


def _fuse_group(experiment: Experiment, jobs: Sequence[Job]) -> Choices:
    first = jobs[0].choices
    if any(job.choices.zipped != first.zipped for job in jobs):
        raise ConfigurationError(f"grid.zip differs between jobs of one store; {SEPARATE}")
    union: dict[Setting, Point] = {}  # of settings that differ
    for setting in experiment.declared:
        values = {value for job in jobs for value in job.choices[setting]}
        _check_origins(setting, [value for job in jobs for value in job.choices[setting]])
        if all(job.choices[setting] == first[setting] for job in jobs):
            continue
        if setting.not_swept:
            listed = " and ".join(quote_value(value) for value in sorted(values, key=sort_key))
            raise ConfigurationError(
                f"{setting.key} is {listed} in jobs of one store, but must be one: "
                f"{setting.not_swept}; {SEPARATE}"
            )
        union[setting] = tuple(sorted(values, key=sort_key))
    values_of = {setting.key: values for setting, values in union.items()}
    zipped = _zipped_axes(jobs, union) if union else []
    merged = {**first.values, **values_of}
    return replace(first, values=merged, zipped=(*first.zipped, *zipped), read_keys=set())


def _check_origins(setting: Setting, values: Sequence[Value]) -> None:
    """Refuse equal names of values that differ in origin."""
    origins = {(value, setting.kind.origin(value)) for value in values}
    counts = Counter(value for value, _ in origins)
    if repeated := [value for value, count in counts.items() if count > 1]:
        raise ConfigurationError(
            f"{setting.key} has {str(repeated[0])!r} for two values in jobs of one store, but "
            f"their names must differ; name one of them, or {SEPARATE}"
        )


def _zipped_axes(jobs: Sequence[Job], union: Mapping[Setting, Point]) -> list[ZippedAxis]:
    """Return zipped axes of the settings that change together.

    If these axes would cross to points that no job has, return one axis of all settings instead.
    """

    def make_zipped_axis(
        name: str, settings: Iterable[Setting], labels: Mapping[Point, str]
    ) -> ZippedAxis:
        keys = tuple(setting.key for setting in settings)
        return ZippedAxis(name, keys, tuple(labels), tuple(labels.values()))

    groups: list[ZippedAxis] = []
    unzipped = list(union)
    for key in jobs[0].overrides:
        decided = [setting for setting in unzipped if _is_decided_by(jobs, key, setting)]
        if len(decided) > 1:
            unzipped = [setting for setting in unzipped if setting not in decided]
            job_points = [tuple(job.choices.value(setting) for setting in decided) for job in jobs]
            labels = {
                point: job.overrides[key] for point, job in zip(job_points, jobs, strict=True)
            }
            name = re.split(r"[/.]", key.lstrip("+"))[-1]
            groups.append(
                make_zipped_axis(name, decided, dict(sorted(labels.items(), key=_label_sort_key)))
            )
    products = (product(*(job.choices[setting] for setting in union)) for job in jobs)
    points = {point for crossed in products for point in crossed}
    sizes = [len(union[setting]) for setting in unzipped] + [len(group.points) for group in groups]
    if math.prod(sizes) == len(points):
        return groups
    ordered = sorted(points, key=lambda point: [sort_key(value) for value in point])
    labels = {
        point: ",".join(
            f"{setting.name}={value}" for setting, value in zip(union, point, strict=True)
        )
        for point in ordered
    }
    return [make_zipped_axis("job", union, labels)]


def _is_decided_by(jobs: Sequence[Job], key: str, setting: Setting) -> bool:
    """Return whether the value swept under a key determines the value of a setting."""
    decided: dict[str | None, Point] = {}
    for job in jobs:
        values = job.choices[setting]
        if len(values) != 1 or decided.setdefault(job.overrides.get(key), values) != values:
            return False
    return len(set(decided.values())) > 1


def _label_sort_key(labelled: tuple[Point, str]) -> tuple[bool, float, str]:
    """Return the sort key of a labelled point: numbers in ascending order, then words."""
    label = labelled[1]
    try:
        return False, float(label), label
    except ValueError:
        return True, 0.0, label
