"""The experiment, assembled from modules that each declare a sensor, a classifier or a study.

Modules come from `sweeps.stages` and from entry points of installed packages in the group
`sweeps.modules`. A module declares groups of settings, and any of the following:

- `STAGES` and `TABLES`: its stages, singly or in tuples, and its tables; the stages of a script
  need no list
- `SENSOR` or `NAME`: its name, if it is a sensor or a classifier
- `CONF`: a folder of configuration files, such as `experiment/mine.yaml`
- `WORDS`: for each setting, the module attribute that lists its allowed words
- `check_first` and `check`: refuse inconsistent choices, or return completed ones; `check_first`
  runs before any ship is built
- `loops`: returns the compiled loops that its stages run
- `about`: returns lines to print before a sweep
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from ncti.machine_code import CompiledLoops
from sweeps.engine.declare.errors import DeclarationError
from sweeps.engine.declare.kinds import Kind, SetOf, Word
from sweeps.engine.declare.settings import Choices, Setting, Settings
from sweeps.engine.declare.stage import Experiment, Stage
from sweeps.engine.run.process import environment
from sweeps.stages import meshes, views
from sweeps.stages.classifier import Classifier
from sweeps.stages.views import Grid, Render, Sweep

TITLE = "Identification of ships by laser radar and passive infrared: parameter sweep"
PACKAGES = ("ncti", "sweeps")  # whose code counts in the keys of results
ENTRY_POINTS = "sweeps.modules"

CORE = tuple(
    import_module(f"sweeps.stages.{name}")
    for name in (
        *("views", "portraits", "ladar", "infrared", "irar", "flights"),
        *("classifier", "acn", "mnn", "correlation", "likelihood", "fusion", "measured"),
        "dataset",
    )
)


def conf_folder() -> Path:
    """Return the configuration's folder: in the installed package, or at the repository root."""
    package = Path(__file__).resolve().parent
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


def load_installed_modules() -> tuple[ModuleType, ...]:
    """Return the modules that installed packages declare, by name; DeclarationError if one fails.

    Studies are registered in this way, as are sensors and classifiers of other packages.
    """
    modules = []
    for entry in sorted(entry_points(group=ENTRY_POINTS), key=lambda entry: entry.name):
        try:
            modules.append(entry.load())
        except Exception as error:
            package = entry.dist.name if entry.dist else "a package"
            raise DeclarationError(
                f"{package} has the entry point {entry.name} of {ENTRY_POINTS}, but {entry.value} "
                f"cannot be imported: {error}; fix it or uninstall {package}"
            ) from error
    return tuple(modules)


def assemble(*modules: Any, code: tuple[str, ...] = ()) -> Experiment:
    """Return the experiment assembled from the declarations of some modules or similar objects.

    `code` names further packages, besides this project's, whose code counts in the keys of results.
    """
    kinds = _kinds(modules)
    settings = tuple(
        replace(setting, kind=kinds[setting.key]) if setting.key in kinds else setting
        for module in modules
        for group in groups_of(module)
        for setting in group.declared
    )
    tables = (table for module in modules for table in getattr(module, "TABLES", ()))

    def check(choices: Choices) -> Choices:
        with environment(choices.variables):
            for name in ("check_first", "check"):
                for module in modules:
                    if hasattr(module, name):
                        choices = getattr(module, name)(choices) or choices
            # A store records the engine that rendered, not the choice "auto".
            return choices.replace(Render.engine, views.drawing_engines(choices))

    def attributes(choices: Choices) -> dict[str, Any]:
        digests = {str(ship): meshes.mesh_source(ship).digest for ship in choices[Grid.ship]}
        transforms = {str(ship): str(ship.transform) for ship in choices[Grid.ship]}
        nonempty = {label: words for label, words in transforms.items() if words}
        return {"mesh_digests": digests} | ({"mesh_transforms": nonempty} if nonempty else {})

    def compile_loops(choices: Choices, say: Callable[[str], None]) -> list[Callable[[], object]]:
        needed = (module.loops(choices) for module in modules if hasattr(module, "loops"))
        distinct = dict.fromkeys(loops for module_loops in needed for loops in module_loops)
        missing = [loops for loops in distinct if loops.are_missing()]
        if missing:
            names = ", ".join(loops.label for loops in missing)
            say(f"compiling the loops of {names} (once, up to half a minute)")
        return [partial(_compile, loops) for loops in missing]

    return Experiment(
        "ncti-sweep",
        TITLE,
        (*settings, *stages_of(modules), *tables),
        check=check,
        prepare=compile_loops,
        attributes=attributes,
        conf=conf_folder(),
        added_conf=tuple(Path(module.CONF) for module in modules if hasattr(module, "CONF")),
        code=(*PACKAGES, *code),
    )


def _compile(loops: CompiledLoops) -> None:
    from ncti.compiled import keep

    keep(loops)


def _kinds(modules: Sequence[Any]) -> dict[str, Kind]:
    """Return the kinds of the settings in `WORDS`, by key, with the words that modules list."""
    kinds: dict[str, Kind] = {}
    for module in modules:
        words: Mapping[Setting, str] = getattr(module, "WORDS", {})
        for setting, attribute in words.items():
            listed = [getattr(owner, attribute) for owner in modules if hasattr(owner, attribute)]
            lists = [(names,) if isinstance(names, str) else names for names in listed]
            word = Word(tuple(name for names in lists for name in names))
            kind = setting.kind
            kinds[setting.key] = replace(kind, kind=word) if isinstance(kind, SetOf) else word
    return kinds


def remarks(modules: Sequence[Any], choices: Choices) -> list[str]:
    """Return the lines to print before a sweep, on unused classifiers and of modules."""
    given_keys = {Classifier.name.key, Classifier.key} & set(choices.given_keys)
    sensors = ",".join(choices.value(Sweep.sensor))
    return [
        f"classifier.name={name} has nothing to do for sensor={sensors}; ignored"
        for name in (idle_classifiers(stages_of(modules), choices) if given_keys else ())
    ] + [line for module in modules if hasattr(module, "about") for line in module.about(choices)]


def groups_of(module: Any) -> tuple[type[Settings], ...]:
    """Return the groups of settings that a module declares, in their order."""
    values = [var for var in vars(module).values() if isinstance(var, type)]
    declared = [value for value in values if value.__module__ == module.__name__]
    return tuple(setting for setting in declared if issubclass(setting, Settings))


def stages_of(modules: Iterable[Any]) -> tuple[Stage, ...]:
    """Return the stages that some modules list as STAGES; the stages of a script need no list."""
    listed = (getattr(module, "STAGES", vars(module).values()) for module in modules)
    values = (value for values_of_module in listed for value in values_of_module)
    tuples = (value if isinstance(value, tuple) else (value,) for value in values)
    return tuple(dict.fromkeys(s for stages in tuples for s in stages if isinstance(s, Stage)))


def idle_classifiers(stages: Iterable[Stage], choices: Choices) -> list[str]:
    """Return the classifiers of a sweep that add no groups to its store."""
    groups = {stage.group for stage in stages if stage.group.path and stage.group.when(choices)}
    names = choices[Classifier.name]

    def drop_classifier(name: str) -> Choices:
        return choices.replace(Classifier.name, tuple(other for other in names if other != name))

    return [name for name in names if all(group.when(drop_classifier(name)) for group in groups)]


INSTALLED = load_installed_modules()
MODULES = (*CORE, *INSTALLED)
EXPERIMENT = assemble(
    *MODULES, code=tuple(dict.fromkeys(module.__name__.partition(".")[0] for module in INSTALLED))
)
