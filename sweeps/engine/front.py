"""Between Hydra and the engine: the schema of a configuration, and the choices that it makes."""

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

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.experiment import Experiment
from sweeps.engine.kinds import ascending
from sweeps.engine.run_settings import CLUSTERS, Together
from sweeps.engine.settings import Choices, Joint, Setting, flatten, nested, read_choices

SCHEMA = "sweep_schema"

HYDRA = {
    # Down to the microsecond: two sweeps may start in one second.
    "run": {"dir": "outputs/${now:%Y-%m-%d}/${now:%H-%M-%S-%f}"},
    "sweep": {"dir": "multirun/${now:%Y-%m-%d}/${now:%H-%M-%S-%f}"},
    "job_logging": {"root": {"level": "WARNING"}},
}


def primary(experiment: Experiment) -> str:
    """Name of the configuration that Hydra starts from."""
    return "config" if experiment.conf is not None else "all_defaults"


def register(experiment: Experiment) -> None:
    """Make the schema of an experiment known to Hydra, and a configuration that is all defaults."""
    known = ConfigStore.instance()
    known.store(name=SCHEMA, node=_schema("Configuration", nested(experiment.declared)))
    for kind in CLUSTERS:
        known.store(group="cluster", name=kind, node={"kind": kind})
    if experiment.conf is None:
        base = [SCHEMA, {"cluster": "local"}, "_self_", {"override hydra/launcher": "fused"}]
        known.store(name=primary(experiment), node={"defaults": base, "hydra": HYDRA})


def _schema(name: str, tree: Mapping[str, Any]) -> type:
    """Dataclass of a group; every value may be anything, since settings check their own."""
    fields: list[Any] = []
    for key, entry in tree.items():
        words: Sequence[str] = getattr(getattr(entry, "kind", None), "fields", ())
        if isinstance(entry, Mapping):
            inner = _schema(key.title(), entry)
            fields.append((key, inner, field(default_factory=inner)))
        elif words:
            inner = make_dataclass(
                key.title(), [(word, Any, field(default=None)) for word in words]
            )
            fields.append((key, inner, field(default_factory=inner)))
        elif isinstance(entry.default, list | dict | tuple):
            fields.append((key, Any, field(default_factory=partial(deepcopy, entry.default))))
        else:
            fields.append((key, Any, field(default=entry.default)))
    return make_dataclass(name, fields)


@contextmanager
def composing(experiment: Experiment) -> Iterator[None]:
    """Let `hydra.compose` find the configuration of an experiment meanwhile."""
    register(experiment)  # another one may have been since
    if experiment.conf is None:
        with hydra.initialize(version_base="1.3", config_path=None):
            yield
    else:
        with hydra.initialize_config_dir(str(experiment.conf), version_base="1.3"):
            yield


def read_configuration(experiment: Experiment, composed: DictConfig) -> Choices:
    """Checked choices of a composed configuration.

    Raises
    ------
    ConfigurationError
        Naming the first key that is wrong, its value and what is allowed.
    """
    tree = nested(experiment.declared)
    _known(tree, composed, "")
    plain: Any = OmegaConf.to_container(composed, resolve=True)
    given = flatten(experiment.declared, plain)
    (groups,) = Together.zip.values(given.get(Together.zip.key))
    together = [[_named(experiment, name) for name in names] for names in groups]
    keys = {one.key for settings in together for one in settings}
    once = {key: _once(value) if key in keys else value for key, value in given.items()}
    choices = read_choices(experiment.declared, once)
    return experiment.check(_zipped(choices, given, together))


def _once(given: Any) -> Any:
    """A list without repetitions, which settings may have that run together."""
    if not isinstance(given, list):
        return given
    return [value for place, value in enumerate(given) if value not in given[:place]]


def _zipped(
    choices: Choices, given: Mapping[str, Any], together: Sequence[Sequence[Setting]]
) -> Choices:
    """The same choices, with the settings of `grid.zip` running together."""
    joint = []
    for settings in together:
        listed = [_as_written(one, given.get(one.key, one.default)) for one in settings]
        lengths = {one.key: len(values) for one, values in zip(settings, listed, strict=True)}
        if len(set(lengths.values())) > 1:
            shown = ", ".join(f"{key} has {n}" for key, n in lengths.items())
            raise ConfigurationError(
                f"grid.zip has {', '.join(lengths)}, which must have as many values each, but "
                f"{shown}"
            )
        points = list(zip(*listed, strict=True))
        if len(set(points)) < len(points):
            raise ConfigurationError(
                f"grid.zip has {', '.join(lengths)}, which have the same values together twice"
            )
        points.sort(key=lambda point: [_rank(value) for value in point])
        keys = tuple(one.key for one in settings)
        joint.append(Joint("_".join(one.name for one in settings), keys, tuple(points)))
    if twice := [key for one in joint for key in one.keys]:
        ascending("grid.zip", twice)
    return Choices(choices.values, (*choices.joint, *joint))


def _as_written(setting: Setting, given: Any) -> list[Any]:
    """Values in the order in which a user gave them."""
    if isinstance(given, Sequence) and not isinstance(given, str):
        return [setting.values(one)[0] for one in given]
    return list(setting.values(given))


def _rank(value: Any) -> tuple[bool, Any]:
    return value is not None, 0 if value is None else value


def _named(experiment: Experiment, name: str) -> Setting:
    """The setting of a key, or of the last word of one."""
    found = [one for one in experiment.declared if one.key == name]
    found = found or [one for one in experiment.declared if one.key == f"grid.{name}"]
    found = found or [one for one in experiment.declared if one.name == name]
    if len(found) != 1:
        several = ", ".join(one.key for one in found)
        hint = f"several keys: {several}" if found else "no setting"
        raise ConfigurationError(f"grid.zip has {name!r}, which is {hint}; give a whole key")
    if found[0].fixed:
        raise ConfigurationError(f"grid.zip has {name!r}, but it takes one value: {found[0].fixed}")
    return found[0]


def _known(tree: Mapping[str, Any], node: Any, parent: str) -> None:
    """Refuse keys that no setting has; Hydra itself lets `+key=value` through."""
    if not isinstance(node, DictConfig):
        raise ConfigurationError(f"{parent} is {node!r}, but must hold {', '.join(tree)}")
    for name in map(str, node):
        key = f"{parent}.{name}".lstrip(".")
        if name not in tree:
            raise ConfigurationError(unknown_key(tree, key))
        if isinstance(tree[name], Mapping):
            _known(tree[name], node[name], key)


def unknown_key(tree: Mapping[str, Any], key: str) -> str:
    """What to say of a key that the configuration lacks, given the keys of its group."""
    parent = key.rpartition(".")[0]
    return f"{key} is no key of the configuration; {parent or 'it'} has {', '.join(tree)}"


def replaceable(experiment: Experiment, arguments: Sequence[str]) -> list[str]:
    """Arguments that let a value of the command line replace the configured one of any form.

    OmegaConf merges a mapping into a mapping and refuses to put a list in its place, or a mapping
    in a list's, so a setting is emptied before it is set: `grid.aspect=[0,45]` becomes
    `++grid.aspect=null grid.aspect=[0,45]` (with `++`, since a multirun keeps one override of
    each spelling).
    """
    keys = {one.key for one in experiment.declared if not getattr(one.kind, "fields", ())}
    found = []
    for argument in arguments:
        plain = argument.lstrip("+")  # a setting is always there, so nothing is added
        key = plain.partition("=")[0]
        found += [f"++{key}=null", plain] if key in keys else [argument]
    return found


def explain(experiment: Experiment, error: Exception) -> str:
    """One sentence for what Hydra and OmegaConf say in several lines."""
    if isinstance(error, ConfigurationError):
        return str(error)
    if isinstance(error, OverrideParseException):
        why = str(error).partition("\n")[0]
        return f"{error.override} cannot be read ({why}), but must be KEY=VALUE as Hydra has it"
    text = "\n".join(str(one) for one in _causes(error))
    key = re.search(r"full_key: (\S+)", text)
    if key and re.search(r"Key '.*' (is )?not in", text):
        tree: Any = nested(experiment.declared)
        for word in key[1].split(".")[:-1]:
            tree = tree.get(word, {}) if isinstance(tree, Mapping) else {}
        if isinstance(tree, Mapping) and tree:
            return unknown_key(tree, key[1])
        return f"{key[1]} is no key of the configuration"
    group = re.search(r"not a subclass of \w+\. value: (.*)|Cannot merge DictConfig with", text)
    if key and group:
        branch: Any = nested(experiment.declared)
        for word in key[1].split("."):
            branch = branch.get(word, {}) if isinstance(branch, Mapping) else {}
        return f"{key[1]} is {group[1] or 'a list'}, but must hold {', '.join(branch or {})}"
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


def refuse_list_of_choices(experiment: Experiment, override: str) -> None:
    """Refuse a list where a group's one file is chosen: Hydra would lay them over one another."""
    several = re.fullmatch(r"(\w+)=(\[.*\])", override)
    if several is None:
        return
    groups = {"cluster"}
    if experiment.conf is not None:
        groups |= {path.name for path in experiment.conf.iterdir() if path.is_dir()}
    if several[1] in groups and several[1] not in {one.key for one in experiment.declared}:
        named = f"{several[1]}.name"
        listed = any(one.key == named for one in experiment.declared)
        hint = f"; {named} takes a list" if listed else ""
        raise ConfigurationError(f"{several[1]} is {several[2]}, but must be one choice{hint}")
