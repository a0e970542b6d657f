"""Text of `--help`: examples, experiments, and the main keys as they are declared."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path

from sweeps.engine.settings import Cluster, Run, Setting, Together, written_default
from sweeps.engine.stage import Experiment

WIDTH = 79  # of 80, so that no terminal breaks a full line
INDENT = 2
WORDS = 50  # columns before which a text beside a word begins

OPTIONS = (
    ("-m, --multirun", "sweep the values a=1,2 as one store"),
    ("--cfg job", "print the whole configuration, without running it"),
    ("--settings", "print every key with its default, bounds and meaning"),
    ("--cache [clear]", "print what is in the cache, or empty it"),
    ("--version", "print the version"),
    ("--hydra-help", "print the other options, such as --shell-completion"),
)
STATUS = (
    "Exit status: 0 all cells are done, 1 some cells failed (they are named), "
    "2 the configuration is wrong."
)


def usage(experiment: Experiment) -> str:
    """Return the text of `--help`, in lines of at most 79 columns."""
    name, title = experiment.name, experiment.title
    parts = [
        textwrap.wrap(f"{name}: {title}.", WIDTH),
        [f"Usage: {name} [+experiment=NAME] [KEY=VALUE ...] [OPTION ...]"],
    ]
    if experiment.examples:
        examples = ((f"{name} {given}".strip(), about) for given, about in experiment.examples)
        parts.append(["Examples:", *_listed(examples)])
    if found := list(descriptions(experiment.conf, "experiment")):
        parts.append(["Experiments (+experiment=NAME):", *_listed(found)])
    keys = _listed((one.key, _about(one)) for one in main_settings(experiment))
    several = "a list, or {start: 0, stop: 90, step: 3}, is an axis of the sweep"
    parts.append([f"Main keys ({several}):", *keys])
    if groups := list(_groups(experiment)):
        parts.append(["Groups of settings (GROUP=NAME):", *_listed(groups)])
    parts += [["Options:", *_listed(OPTIONS)], textwrap.wrap(STATUS, WIDTH)]
    return "\n\n".join("\n".join(part) for part in parts)


def main_settings(experiment: Experiment) -> list[Setting]:
    """Return the settings that `--help` lists: the main keys, and those of every run."""
    keys = experiment.main
    own = [
        one
        for group in experiment.settings
        for one in group.declared
        if not keys or one.key in keys or one.key.partition(".")[0] in keys
    ]
    return [*own, *Together.declared, *Run.declared, Cluster.kind, Cluster.workers]


def descriptions(conf: Path | None, group: str) -> Iterator[tuple[str, str]]:
    """Yield name and description of the files of a group: their first line of comment.

    Comments for OmegaConf, such as `# @package`, do not count.
    """
    for path in sorted((conf / group).glob("*.yaml")) if conf is not None else ():
        lines = path.read_text(encoding="utf-8").splitlines()
        comments = (one[1:].strip() for one in lines if one.startswith("#"))
        yield path.stem, next((one for one in comments if not one.startswith("@")), "")


def _groups(experiment: Experiment) -> Iterator[tuple[str, str]]:
    """Yield groups of the configuration except experiments, with the names of their files."""
    folders = sorted(experiment.conf.iterdir()) if experiment.conf is not None else ()
    for folder in folders:
        names = ", ".join(name for name, _ in descriptions(experiment.conf, folder.name))
        if folder.is_dir() and folder.name != "experiment":
            yield folder.name, names


def _about(setting: Setting) -> str:
    """Return the label of a setting, with its unit and default."""
    unit = f" [{setting.unit}]" if setting.unit != "1" else ""
    return f"{setting.label}{unit}; default {written_default(setting.default)}"


def _listed(entries: Iterable[tuple[str, str]]) -> list[str]:
    """Return lines of words with texts beside them, or below a long word."""
    entries = list(entries)
    short = [len(word) for word, _ in entries if INDENT + len(word) + 2 <= WORDS]
    start = INDENT + max(short, default=INDENT) + 2
    lines = []
    for word, about in entries:
        texts = textwrap.wrap(about, WIDTH - start, break_on_hyphens=False)
        first = " " * INDENT + word
        if len(first) + 2 > start:
            lines.append(first)
        elif texts:
            lines.append(f"{first:<{start}}{texts.pop(0)}")
        else:
            lines.append(first)
        lines += [" " * start + text for text in texts]
    return lines
