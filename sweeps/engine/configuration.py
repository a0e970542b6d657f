"""The configuration of an experiment: its schema, composed by Hydra, and its choices."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import hydra
from hydra.core.config_store import ConfigStore
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import rank, shown
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

SCHEMA = "sweep_schema"
ALIKE = 0.75  # least similarity of a key that may have been meant


# composing ----------------------------------------------------------------------------------------


def primary(experiment: Experiment) -> str:
    """Return the name of the primary configuration of Hydra."""
    return "config" if experiment.conf is not None else "all_defaults"


def register(experiment: Experiment) -> None:
    """Register the schema of an experiment and its default configuration with Hydra."""
    known = ConfigStore.instance()
    known.store(name=SCHEMA, node=_schema(nested(experiment.by_key)))
    for kind in CLUSTERS:
        known.store(group="cluster", name=kind, node={"kind": kind})
    if experiment.conf is None:
        base = [SCHEMA, {"cluster": "local"}, "_self_"]
        node = {"defaults": base, "hydra": {"job": {"name": experiment.name}}}
        known.store(name=primary(experiment), node=node)


def _schema(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return the defaults of a group; values are of any type, since settings check their own."""
    return {
        key: _schema(inner) if (inner := members(entry)) else getattr(entry, "written", None)
        for key, entry in tree.items()
    }


def members(entry: Any) -> Mapping[str, Any]:
    """Return members of a group, or of a setting whose value is a mapping with certain keys."""
    if isinstance(entry, Mapping):
        return entry
    return dict.fromkeys(getattr(getattr(entry, "kind", None), "fields", ()))


@contextmanager
def composing(experiment: Experiment) -> Iterator[None]:
    """Let Hydra find the configuration of an experiment within this context."""
    register(experiment)
    if experiment.conf is None:
        with hydra.initialize(version_base="1.3", config_path=None):
            yield
    else:
        with hydra.initialize_config_dir(str(experiment.conf), version_base="1.3"):
            yield


def composed(experiment: Experiment, overrides: Sequence[str]) -> DictConfig:
    """Return the configuration of some overrides."""
    try:
        return hydra.compose(primary(experiment), overrides=replaceable(experiment, overrides))
    except (HydraException, OmegaConfBaseException, TypeError, ValueError) as error:
        raise ConfigurationError(f"{in_one_line(error)} (of {' '.join(overrides)})") from error


def replaceable(experiment: Experiment, overrides: Sequence[str]) -> list[str]:
    """Return overrides with which a value may replace a configured one of another form.

    OmegaConf merges a mapping into a mapping and refuses to put a list in its place, or a mapping
    in a list's, so a setting is emptied before it is set: `spring.mass=[0,45]` becomes
    `++spring.mass=null spring.mass=[0,45]` (with `++`, since a multirun keeps one override of
    each spelling).
    """
    keys = {setting.key for setting in experiment.declared if not members(setting)}
    found = []
    for override in overrides:
        plain = override.lstrip("+")  # a setting is always there, so nothing is added
        key = plain.partition("=")[0]
        found += [f"++{key}=null", plain] if key in keys else [override]
    return found


def in_one_line(error: BaseException | None) -> str:
    """Return the message of an error, and those of its causes, in one line."""
    words = []
    while error is not None:
        if isinstance(error, OmegaConfBaseException):  # whose other lines name its classes
            words += [f"{error.full_key}:", *str(error).partition("\n")[0].split()]
        else:
            words += str(error).split()
        error = error.__cause__
    return " ".join(words)


# choices ------------------------------------------------------------------------------------------


def read_configuration(experiment: Experiment, composed: DictConfig) -> Choices:
    """Return the choices of a composed configuration, each setting checked by itself.

    Raises
    ------
    ConfigurationError
        Naming the first invalid key, its value and what is allowed.
    """
    written: Any = OmegaConf.to_container(composed, resolve=False)
    _check_tree(experiment, nested(experiment.by_key), written, "")
    try:
        values: Any = OmegaConf.to_container(composed, resolve=True)
    except OmegaConfBaseException as error:
        key = (error.full_key or "").partition("[")[0]
        given = flatten(experiment.declared, written)
        why = str(error).partition("\n")[0]
        raise ConfigurationError(
            f"{key} is {given.get(key)}, but must refer to keys that have a value ({why})"
        ) from error
    given = flatten(experiment.declared, values)
    (groups,) = Together.zip.values(given.get(Together.zip.key))
    together = [[_named(experiment, name) for name in names] for names in groups]
    joint = [_joint(settings, given) for settings in together]
    zipped = [key for one in joint for key in one.keys]
    if twice := [key for key in zipped if zipped.count(key) > 1]:
        raise ConfigurationError(
            f"grid.zip has {twice[0]!r} more than once, but values must differ"
        )
    for key in zipped:  # together, one may have a value several times
        if isinstance(listed := given.get(key), list):
            given[key] = [one for at, one in enumerate(listed) if one not in listed[:at]]
    choices = read_choices(experiment.declared, given)
    return Choices(choices.values, (*choices.joint, *joint))


def _check_tree(experiment: Experiment, tree: Mapping[str, Any], node: Any, parent: str) -> None:
    """Refuse unknown keys of a configuration; Hydra itself accepts `+key=value`."""
    if not isinstance(node, Mapping):
        raise not_members(tree, parent, node)
    for name in map(str, node):
        key = f"{parent}.{name}".lstrip(".")
        if name not in tree:
            raise unknown(experiment, tree, parent, key)
        if isinstance(tree[name], Mapping):
            _check_tree(experiment, tree[name], node[name], key)


def not_members(tree: Mapping[str, Any], key: str, value: Any) -> ConfigurationError:
    """Return the error of a group that is given another value."""
    return ConfigurationError(f"{key} is {shown(value)}, but must hold {', '.join(tree)}")


def unknown(
    experiment: Experiment, tree: Mapping[str, Any], group: str, key: str
) -> ConfigurationError:
    """Return the error of a key that its group, of the keys of `tree`, does not have."""
    last = key.rpartition(".")[2]
    wrong = f"{key} is not a key of the configuration"
    elsewhere = [setting.key for setting in experiment.declared if setting.key.endswith(f".{last}")]
    meant = difflib.get_close_matches(key, elsewhere, n=1, cutoff=ALIKE) or elsewhere
    if not meant:
        near = difflib.get_close_matches(last, tree, n=1, cutoff=ALIKE)
        meant = [f"{group}.{name}".lstrip(".") for name in near]
    if meant:
        return ConfigurationError(f"{wrong}; did you mean {' or '.join(meant)}?")
    return ConfigurationError(f"{wrong}; {group or 'it'} has {', '.join(tree) or 'no keys'}")


# settings that run together -----------------------------------------------------------------------


def _joint(settings: Sequence[Setting], given: Mapping[str, Any]) -> Joint:
    """Return the joint axis of settings that run together."""
    keys = [setting.key for setting in settings]
    listed = [_as_written(setting, given.get(setting.key, setting.written)) for setting in settings]
    if len(set(map(len, listed))) > 1:
        counts = (f"{key} has {len(values)}" for key, values in zip(keys, listed, strict=True))
        raise ConfigurationError(
            f"grid.zip has {', '.join(keys)}, which must have equally many values, but "
            f"{', '.join(counts)}"
        )
    points = sorted(zip(*listed, strict=True), key=lambda point: [rank(one) for one in point])
    if len(set(points)) < len(points):
        raise ConfigurationError(
            f"grid.zip has {', '.join(keys)}, which have the same values together twice"
        )
    return Joint("_".join(setting.name for setting in settings), tuple(keys), tuple(points))


def _as_written(setting: Setting, given: Any) -> list[Any]:
    """Return values in the order in which they were given."""
    if isinstance(given, list | tuple):
        return [setting.values(one)[0] for one in given]
    return list(setting.values(given))


def _named(experiment: Experiment, name: str) -> Setting:
    """Return the setting of a key, or of the last word of one."""
    exact = experiment.by_key.get(name) or experiment.by_key.get(f"{Together.key}.{name}")
    found = (
        [exact] if exact else [setting for setting in experiment.declared if setting.name == name]
    )
    if len(found) != 1:
        several = ", ".join(one.key for one in found)
        hint = f"several keys: {several}" if found else "not a setting"
        raise ConfigurationError(f"grid.zip has {name!r}, which is {hint}; give a whole key")
    if found[0].fixed:
        raise ConfigurationError(f"grid.zip has {name!r}, but it takes one value: {found[0].fixed}")
    return found[0]
