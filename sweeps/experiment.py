"""The experiment, assembled from the declarations of the modules of `sweeps.stages`.

A module declares groups of settings, stages, by themselves or in tuples, and perhaps TABLES;
SENSOR or NAME, if it is a sensor or a classifier; `check`, which refuses inconsistent choices,
`check_first`, which does so, or completes them, before any ship is built, and `about`, which
returns lines on them. To add one, pass it to `assemble` with `MODULES`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from ncti.classify.loops import DENSITIES
from ncti.infrared.loops import IMAGES
from ncti.irar.loops import TILTS
from ncti.ladar.loops import BOXES, FRAMES
from ncti.render.choice import choose_engine
from ncti.render.loops import LINES, MASK, of_engine
from sweeps.engine.declare.kinds import Kind, SetOf, Word
from sweeps.engine.declare.settings import Choices, Settings
from sweeps.engine.declare.stage import Experiment, Stage
from sweeps.engine.run.process import environment
from sweeps.stages import views
from sweeps.stages.benchmark import Benchmark
from sweeps.stages.classifier import Classifier
from sweeps.stages.dataset import SENSOR as DATASET
from sweeps.stages.infrared import silhouette_engine
from sweeps.stages.ladar import stores_moments
from sweeps.stages.reproduce import SENSOR as REPRODUCE
from sweeps.stages.views import Grid, Render, Sweep, looks

TITLE = "Identification of ships by laser radar and passive infrared: parameter sweep"

MODULES = tuple(
    import_module(f"sweeps.stages.{name}")
    for name in (
        *("views", "portraits", "ladar", "infrared", "irar", "flights"),
        *("classifier", "acn", "mnn", "correlation", "likelihood", "fusion", "measured"),
        *("run_time", "scan", "dataset", "reproduce", "operate", "benchmark"),
    )
)


def conf_folder() -> Path:
    """Return the configuration's folder: in the installed package, or at the repository root."""
    package = Path(__file__).resolve().parent
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


def assemble(*modules: Any, code: tuple[str, ...] = ()) -> Experiment:
    """Return the experiment assembled from the declarations of some modules or similar objects.

    `code` names further packages, besides this project's, whose code counts in the keys of results.
    """

    def declared(name: str) -> tuple[Any, ...]:
        return tuple(value for module in modules for value in getattr(module, name, ()))

    def named(name: str) -> Word:
        return Word(tuple(getattr(module, name) for module in modules if hasattr(module, name)))

    sensors, entries = Sweep.sensor.kind, Benchmark.classifier.kind
    assert isinstance(sensors, SetOf)
    assert isinstance(entries, SetOf)
    kinds: dict[str, Kind] = {
        Sweep.sensor.key: replace(sensors, kind=named("SENSOR")),
        Classifier.name.key: named("NAME"),
        Benchmark.classifier.key: replace(entries, kind=Word(declared("ENTRIES"))),
    }
    settings = tuple(
        replace(setting, kind=kinds[setting.key]) if setting.key in kinds else setting
        for module in modules
        for group in groups_of(module)
        for setting in group.declared
    )

    def check(choices: Choices) -> Choices:
        with environment(choices.variables):
            for name in ("check_first", "check"):
                for module in modules:
                    if hasattr(module, name):
                        choices = getattr(module, name)(choices)
            # A store records the engine that rendered, not the choice "auto".
            return choices.having(Render.engine, views.drawing_engines(choices))

    def attributes(choices: Choices) -> dict[str, Any]:
        digests = {str(ship): views.hull.function(ship).digest for ship in choices[Grid.ship]}
        transforms = {str(ship): str(ship.transform) for ship in choices[Grid.ship]}
        given = {label: words for label, words in transforms.items() if words}
        return {"mesh_digests": digests} | ({"mesh_transforms": given} if given else {})

    return Experiment(
        "ncti-sweep",
        TITLE,
        (*settings, *stages_of(modules), *declared("TABLES")),
        check=check,
        prepare=compile_loops,
        attributes=attributes,
        conf=conf_folder(),
        code=("ncti", "sweeps", *code),
    )


def about(modules: Sequence[Any], choices: Choices) -> list[str]:
    """Return lines on what is swept, of some modules and of classifiers without any use."""
    # Flights, run times, scans, settings and the benchmark have classifiers of their own, and data
    # sets have none.
    own = {views.IRAR, views.RUN_TIME, views.SCAN, views.OPERATE, views.BENCHMARK}
    alone = (own | {DATASET, REPRODUCE}) & set(choices.one(Sweep.sensor))
    return [
        f"classifier.name has {name}, which identifies nothing with these sensors and ranges"
        for name in (() if alone else idle(stages_of(modules), choices))
    ] + [line for module in modules if hasattr(module, "about") for line in module.about(choices)]


def compile_loops(choices: Choices, say: Callable[[str], None]) -> None:
    """Compile the loops that the sensors of a sweep run, except those already compiled.

    One process does so before others run them.
    """
    engines = {*choices[Render.engine]}
    needed = [*map(of_engine, sorted(engines)), *[BOXES] * (engines != {LINES})]
    if any(looks(sensor)(choices) for sensor in (views.RANGE, DATASET, views.BENCHMARK)):
        needed.append(FRAMES)
    if looks(DATASET)(choices):
        needed += [of_engine(LINES), IMAGES]
    if looks(views.BENCHMARK)(choices):
        needed.append(of_engine(LINES))
    if stores_moments(choices):
        needed.append(DENSITIES)
    if looks(views.INFRARED)(choices):
        needed.append(IMAGES)
        needed += [of_engine(MASK)] if MASK in map(silhouette_engine.function, engines) else []
    if looks(views.IRAR)(choices):
        needed.append(TILTS)
        needed += [of_engine(choose_engine("auto"))] if LINES in engines else []  # it needs pixels
    for loops in needed:
        if loops.are_missing():
            say(f"compiling the loops of {loops.of} (once, a few seconds)")
            from ncti.compiled import keep  # numba takes long to import

            keep(loops)


def groups_of(module: Any) -> tuple[type[Settings], ...]:
    """Return the groups of settings that a module declares, in the order in which it does."""
    values = [var for var in vars(module).values() if isinstance(var, type)]
    own = [value for value in values if value.__module__ == module.__name__]
    return tuple(setting for setting in own if issubclass(setting, Settings))


def stages_of(modules: Iterable[Any]) -> tuple[Stage, ...]:
    """Return the stages that some modules declare, in the order in which they do."""
    values = [value for module in modules for value in vars(module).values()]
    several = (value if isinstance(value, tuple) else (value,) for value in values)
    return tuple(dict.fromkeys(s for stages in several for s in stages if isinstance(s, Stage)))


def idle(stages: Iterable[Stage], choices: Choices) -> list[str]:
    """Return the classifiers of a sweep that add no groups to its store."""
    asked = {stage.group for stage in stages if stage.group.path and stage.group.when(choices)}
    names = choices[Classifier.name]

    def without(name: str) -> Choices:
        return choices.having(Classifier.name, tuple(other for other in names if other != name))

    return [name for name in names if all(group.when(without(name)) for group in asked)]


EXPERIMENT = assemble(*MODULES)
