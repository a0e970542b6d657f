"""The interface to Hydra: the schema of a configuration, and its choices."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import field, make_dataclass
from functools import partial
from typing import Any

import hydra
from hydra.core.config_store import ConfigStore
from hydra.errors import OverrideParseException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import rank
from sweeps.engine.settings import (
    CLUSTERS,
    Choices,
    Joint,
    Setting,
    Together,
    flatten,
    nested,
    read_choices,
)
from sweeps.engine.stage import Experiment

SCHEMA, FUSED = "sweep_schema", "fused"

HYDRA = {
    # Down to the microsecond: two sweeps may start in one second.
    "run": {"dir": "outputs/${now:%Y-%m-%d}/${now:%H-%M-%S-%f}"},
    "sweep": {"dir": "multirun/${now:%Y-%m-%d}/${now:%H-%M-%S-%f}"},
    # What libraries log goes to stderr like all messages, and into no file.
    "job_logging": {
        "root": {"level": "WARNING", "handlers": ["console"]},
        "formatters": {"simple": {"format": "${hydra.job.name}: %(message)s"}},
        "handlers": {"console": {"stream": "ext://sys.stderr"}, "file": {"delay": True}},
    },
}


def primary(experiment: Experiment) -> str:
    """Return the name of the primary configuration of Hydra."""
    return "config" if experiment.conf is not None else "all_defaults"


def register(experiment: Experiment) -> None:
    """Register the schema of an experiment and its default configuration with Hydra."""
    known = ConfigStore.instance()
    known.store(name=SCHEMA, node=_schema("Configuration", nested(experiment.declared)))
    # With it, a multirun is one sweep, run by `Command`; if another sweeper starts
    # the jobs, each is a sweep of its own.
    target = "hydra._internal.core_plugins.basic_launcher.BasicLauncher"
    known.store(group="hydra/launcher", name=FUSED, node={"_target_": target})
    for kind in CLUSTERS:
        known.store(group="cluster", name=kind, node={"kind": kind})
    if experiment.conf is None:
        base = [SCHEMA, {"cluster": "local"}, "_self_", {"override hydra/launcher": FUSED}]
        known.store(
            name=primary(experiment),
            node={"defaults": base, "hydra": {**HYDRA, "job": {"name": experiment.name}}},
        )


def _schema(name: str, tree: Mapping[str, Any]) -> type:
    """Return the dataclass of a group; values are of any type, since settings check their own."""
    fields: list[Any] = []
    for key, entry in tree.items():
        if members := _members(entry):
            inner = _schema(key.title(), members)
            fields.append((key, inner, field(default_factory=inner)))
        else:
            default = getattr(entry, "default", None)
            fields.append((key, Any, field(default_factory=partial(deepcopy, default))))
    return make_dataclass(name, fields)


def _members(entry: Any) -> Mapping[str, Any]:
    """Return members of a group, or of a setting whose value is a mapping with certain keys."""
    if isinstance(entry, Mapping):
        return entry
    return dict.fromkeys(getattr(getattr(entry, "kind", None), "fields", ()))


@contextmanager
def composing(experiment: Experiment) -> Iterator[None]:
    """Let `hydra.compose` find the configuration of an experiment within this context."""
    register(experiment)  # another one may have been registered since
    if experiment.conf is None:
        with hydra.initialize(version_base="1.3", config_path=None):
            yield
    else:
        with hydra.initialize_config_dir(str(experiment.conf), version_base="1.3"):
            yield


@contextmanager
def legible(overrides: Sequence[str]) -> Iterator[None]:
    """Refuse overrides for which Hydra raises a Python error."""
    try:
        yield
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"{' '.join(overrides)}: {error}") from error


# choices ------------------------------------------------------------------------------------------


def read_configuration(experiment: Experiment, composed: DictConfig) -> Choices:
    """Return the checked choices of a composed configuration.

    Raises
    ------
    ConfigurationError
        Naming the first invalid key, its value and what is allowed.
    """
    _known(nested(experiment.declared), composed, "")
    given = flatten(experiment.declared, _resolved(experiment, composed))
    (groups,) = Together.zip.values(given.get(Together.zip.key))
    together = [[_named(experiment, name) for name in names] for names in groups]
    keys = {one.key for settings in together for one in settings}
    once = {key: _once(value) if key in keys else value for key, value in given.items()}
    choices = read_choices(experiment.declared, once)
    return experiment.check(_zipped(choices, given, together))


def _known(tree: Mapping[str, Any], node: Any, parent: str) -> None:
    """Refuse unknown keys; Hydra itself accepts `+key=value`."""
    if not isinstance(node, DictConfig):
        raise ConfigurationError(f"{parent} is {node!r}, but must hold {', '.join(tree)}")
    for name in map(str, node):
        key = f"{parent}.{name}".lstrip(".")
        if name not in tree:
            raise ConfigurationError(_unknown(tree, key))
        if isinstance(tree[name], Mapping):
            _known(tree[name], node[name], key)


def _resolved(experiment: Experiment, composed: DictConfig) -> Any:
    """Return the configuration as plain values, with references resolved."""
    try:
        return OmegaConf.to_container(composed, resolve=True)
    except OmegaConfBaseException as error:
        key = re.sub(r"\[.*", "", error.full_key or "")
        given = OmegaConf.to_container(composed, resolve=False)
        for word in key.split("."):
            given = given.get(word) if isinstance(given, dict) else given
        named = re.search(r"Interpolation key '(.*)' not found", str(error))
        why = str(error).partition("\n")[0]
        if named:
            group = named[1].rpartition(".")[0]
            members = ", ".join(_group(experiment, group)) or "no keys"
            why = f"{named[1]} is not a key of the configuration; {group or 'it'} has {members}"
        raise ConfigurationError(
            f"{key} is {given}, but must refer to keys that have a value ({why})"
        ) from error


def _group(experiment: Experiment, key: str) -> Mapping[str, Any]:
    """Return the members of a group of the configuration."""
    entry: Any = nested(experiment.declared)
    for word in key.split(".") if key else ():
        entry = _members(entry).get(word)
    return _members(entry)


def _unknown(tree: Mapping[str, Any], key: str) -> str:
    """Return the message for an unknown key, given the keys of its group."""
    parent = key.rpartition(".")[0]
    return f"{key} is not a key of the configuration; {parent or 'it'} has {', '.join(tree)}"


# settings that run together -----------------------------------------------------------------------


def _once(given: Any) -> Any:
    """Return a list without repetitions, which joint settings may have."""
    if not isinstance(given, list):
        return given
    return [value for place, value in enumerate(given) if value not in given[:place]]


def _zipped(
    choices: Choices, given: Mapping[str, Any], together: Sequence[Sequence[Setting]]
) -> Choices:
    """Return the choices with the settings of `grid.zip` running together."""
    every = [one.key for settings in together for one in settings]
    if twice := [key for key in every if every.count(key) > 1]:
        raise ConfigurationError(
            f"grid.zip has {twice[0]!r} more than once, but values must differ"
        )
    joint = []
    for settings in together:
        keys = tuple(one.key for one in settings)
        listed = [_as_written(one, given.get(one.key, one.default)) for one in settings]
        if len(set(map(len, listed))) > 1:
            counts = (f"{key} has {len(of)}" for key, of in zip(keys, listed, strict=True))
            raise ConfigurationError(
                f"grid.zip has {', '.join(keys)}, which must have equally many values, but "
                f"{', '.join(counts)}"
            )
        points = list(zip(*listed, strict=True))
        if len(set(points)) < len(points):
            raise ConfigurationError(
                f"grid.zip has {', '.join(keys)}, which have the same values together twice"
            )
        points.sort(key=lambda point: [rank(value) for value in point])
        joint.append(Joint("_".join(one.name for one in settings), keys, tuple(points)))
    return Choices(choices.values, (*choices.joint, *joint))


def _as_written(setting: Setting, given: Any) -> list[Any]:
    """Return values in the order in which they were given."""
    if isinstance(given, Sequence) and not isinstance(given, str):
        return [setting.values(one)[0] for one in given]
    return list(setting.values(given))


def _named(experiment: Experiment, name: str) -> Setting:
    """Return the setting of a key, or of the last word of one."""
    by_key = {one.key: one for one in experiment.declared}
    exact = by_key.get(name) or by_key.get(f"{Together.key}.{name}")
    found = [exact] if exact else [one for one in experiment.declared if one.name == name]
    if len(found) != 1:
        several = ", ".join(one.key for one in found)
        hint = f"several keys: {several}" if found else "not a setting"
        raise ConfigurationError(f"grid.zip has {name!r}, which is {hint}; give a whole key")
    if found[0].fixed:
        raise ConfigurationError(f"grid.zip has {name!r}, but it takes one value: {found[0].fixed}")
    return found[0]


# the command line ---------------------------------------------------------------------------------


def replaceable(experiment: Experiment, arguments: Sequence[str]) -> list[str]:
    """Return arguments with which a value may replace a configured one of another form.

    OmegaConf merges a mapping into a mapping and refuses to put a list in its place, or a mapping
    in a list's, so a setting is emptied before it is set: `spring.mass=[0,45]` becomes
    `++spring.mass=null spring.mass=[0,45]` (with `++`, since a multirun keeps one override of
    each spelling).
    """
    keys = {one.key for one in experiment.declared if not _members(one)}
    found = []
    for argument in arguments:
        plain = argument.lstrip("+")  # a setting is always there, so nothing is added
        key = plain.partition("=")[0]
        found += [f"++{key}=null", plain] if key in keys else [argument]
    return found


def refuse_list_of_choices(experiment: Experiment, override: str) -> None:
    """Refuse a list where one file of a group is chosen: Hydra would merge the files."""
    several = re.fullmatch(r"(\w+)=(\[.*\])", override)
    folders = experiment.conf.iterdir() if experiment.conf is not None else ()
    groups = {"cluster"} | {path.name for path in folders if path.is_dir()}
    keys = {one.key for one in experiment.declared}
    if several is not None and several[1] in groups - keys:
        named = f"{several[1]}.name"
        hint = f"; {named} takes a list" if named in keys else ""
        raise ConfigurationError(f"{several[1]} is {several[2]}, but must be one choice{hint}")


def explain(experiment: Experiment, error: Exception) -> str:
    """Return one sentence for an error of Hydra or OmegaConf of several lines."""
    if isinstance(error, ConfigurationError):
        return str(error)
    if isinstance(error, OverrideParseException):
        why = str(error).partition("\n")[0]
        return f"{error.override} cannot be read ({why}), but must be KEY=VALUE in Hydra's syntax"
    text = "\n".join(str(one) for one in _causes(error))
    if key := re.search(r"full_key: (\S+)", text):
        if re.search(r"Key '.*' (is )?not in", text):
            group = _group(experiment, key[1].rpartition(".")[0])
            words = f"{key[1]} is not a key of the configuration"
            return _unknown(group, key[1]) if group else words
        value = re.search(r"not a subclass of \w+\. value: (.*)", text)
        wrong = r"not a subclass of|Cannot merge DictConfig with|is not Optional"
        if re.search(wrong, text) and (group := _group(experiment, key[1])):
            given = value[1] if value else "null" if "is not Optional" in text else "a list"
            return f"{key[1]} is {given}, but must hold {', '.join(group)}"
    choice = re.search(
        r"Could not find '(.+)/(.+)'.*?Available options in .*?:(.*?)\n\S", text, re.S
    )
    if choice:
        options = ", ".join(choice[3].split())
        return f"{choice[1]} is {choice[2]!r}, but must be one of {options}"
    return " ".join(text.split())


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__
