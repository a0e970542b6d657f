"""The experiment: what the modules of `sweeps.stages` declare, put together.

A module declares any of SETTINGS, STAGES, TABLES and STATUSES; SENSOR or NAME, if it is a sensor or
a classifier; and `check`, which refuses choices that make no sense. To add one, give it to
`assemble` beside `MODULES`.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from sweeps.engine.kinds import Kind, Word
from sweeps.engine.settings import Choices, Run, Setting, Settings
from sweeps.engine.stage import Experiment, Stage
from sweeps.stages import (
    acn,
    acn_infrared,
    classifier,
    corrections,
    correlation,
    flight_checks,
    flights,
    fusion,
    images,
    infrared,
    irar,
    ladar,
    likelihood,
    measured,
    mnn,
    signatures,
    silhouettes,
    views,
)
from sweeps.stages.views import (
    CACHE_VARIABLE,
    IRAR,
    Grid,
    Render,
    Sweep,
    drawing_engine,
    hull,
    looks,
    read_mesh,
)

TITLE = "Identification of ships by laser radar and passive infrared: parameter sweep"

MODULES: tuple[Any, ...] = (
    views,
    ladar,
    infrared,
    images,
    silhouettes,
    irar,
    flights,
    corrections,
    signatures,
    flight_checks,
    classifier,
    acn,
    mnn,
    correlation,
    likelihood,
    acn_infrared,
    fusion,
    measured,
)

VERSIONS = (
    *("ncti-sweep", "PyOpenGL", "embreex", "manifold3d", "networkx", "pyrender", "scikit-image"),
    *("scikit-learn", "scipy", "trimesh"),
)


def conf_folder() -> Path:
    """Folder of the configuration: inside the installed package, or at the repository root."""
    package = Path(__file__).resolve().parent
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


def assemble(*modules: Any, code: tuple[str, ...] = ()) -> Experiment:
    """Experiment of what some modules declare.

    Parameters
    ----------
    *modules : module
        Or anything that has the same names.
    code : tuple of str
        Further packages, besides this project's, whose code counts in the keys of results.
    """
    sensors = _declared(modules, "SENSOR")
    names = _declared(modules, "NAME")
    words = {
        Sweep.sensor.key: replace(Sweep.sensor.kind, kind=Word(sensors)),  # type: ignore[call-arg]
        classifier.Classifier.name.key: Word(names),
    }
    groups = tuple(
        _with_words(group, words) for one in modules for group in getattr(one, "SETTINGS", ())
    )

    stages: tuple[Stage, ...] = tuple(
        stage for one in modules for stage in getattr(one, "STAGES", ())
    )

    def check(choices: Choices) -> Choices:
        if folder := choices.one(Run.cache):
            os.environ[CACHE_VARIABLE] = os.path.abspath(folder)  # workers inherit it
        for one in modules:
            if hasattr(one, "check"):
                choices = one.check(choices)
            if hasattr(one, "check_meshes"):
                one.check_meshes(choices, lambda ship: read_mesh(hull.function(ship)))
        # What drew is part of a store's name, not that something should.
        engines = sorted({drawing_engine.function(word) for word in choices[Render.engine]})
        return choices.having(Render.engine, tuple(engines))

    def remarks(choices: Choices) -> list[str]:
        return [
            f"classifier.name has {name}, which names nothing with these sensors and ranges"
            for name in idle(stages, choices)
            if not looks(IRAR)(choices)
        ]

    return Experiment(
        "ncti-sweep",
        TITLE,
        groups,
        stages,
        tables=tuple(table for one in modules for table in getattr(one, "TABLES", ())),
        statuses=tuple(status for one in modules for status in getattr(one, "STATUSES", ())),
        check=check,
        checking="checking what is asked for, and building its ships",
        remarks=remarks,
        versions=VERSIONS,
        attributes=_attributes,
        conf=conf_folder(),
        code=("ncti", "sweeps", *code),
    )


def idle(stages: Iterable[Stage], choices: Choices) -> list[str]:
    """Return those classifiers of a sweep without which it would have the same groups."""
    setting = classifier.Classifier.name
    asked = [stage for stage in stages if stage.group is not None and stage.when(choices)]

    def without(name: str) -> Choices:
        return choices.having(setting, tuple(one for one in choices[setting] if one != name))

    return [name for name in choices[setting] if all(one.when(without(name)) for one in asked)]


def _declared(modules: Iterable[Any], name: str) -> tuple[str, ...]:
    found = (getattr(one, name, None) for one in modules)
    return tuple(word for word in found if word is not None)


def _with_words(group: type[Settings], words: Mapping[str, Kind]) -> type[Settings]:
    """A group of settings, those of some keys with other words to choose from."""
    if not any(setting.key in words for setting in group.declared):
        return group
    members: dict[str, Setting] = {
        setting.key.rpartition(".")[2]: replace(setting, kind=words[setting.key])
        if setting.key in words
        else setting
        for setting in group.declared
    }
    return type(group.__name__, (Settings,), {"__doc__": group.__doc__, **members}, key=group.key)


def _attributes(choices: Choices) -> dict[str, Any]:
    digests = {str(ship): hull.function(ship).digest for ship in choices[Grid.ship]}
    return {"mesh_digests": digests}


EXPERIMENT = assemble(*MODULES)
