"""Texts of `--help` and `--settings`: examples, experiments, and declared keys."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import yaml

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.kinds import format_value
from sweeps.engine.declare.settings import DIMENSION, Cluster, Run, Setting, Zip
from sweeps.engine.declare.stage import Experiment

WIDTH = 79  # of 80, so that no terminal breaks a full line
INDENT = "  "
MAX_WORD = 46  # longest word with its text beside it

OPTIONS = (
    ("-m, --multirun", "sweep the values a=1,2 as one store"),
    ("--cfg job", "print the whole configuration, without running it"),
    ("--settings [WORD]", "print every key, or those of a word, with default, bounds, meaning"),
    (
        "--cache [prune=20GB]",
        "print the size of the cache, or delete the oldest results above a size",
    ),
    ("--why", "print why stages would be computed again for store=PATH"),
    ("--status", "print the progress of the sweep of store=PATH, from another terminal"),
    ("--version", "print the version"),
    ("--hydra-help", "print the other options, such as --shell-completion"),
)
STATUS = (
    "Exit status: 0 all cells are done, 1 some cells failed (they are named), "
    "2 the configuration is wrong."
)


def usage(experiment: Experiment) -> str:
    """Return the text of `--help`, in lines of at most 79 columns."""
    name, conf = experiment.name, experiment.conf
    syntax = "a list, or {start: 0, stop: 90, step: 3}, is an axis of the sweep"
    folders = sorted(path.name for path in conf.iterdir() if path.is_dir()) if conf else []
    groups = {
        folder: ", ".join(file for file, _ in descriptions(conf, folder))
        for folder in folders
        if folder != "experiment"
    }
    sections: dict[str, Iterable[tuple[str, str]]] = {
        "Experiments (+experiment=NAME):": descriptions(conf, "experiment"),
        "Studies (+experiment=NAME):": [
            entry
            for folder in experiment.added_conf
            for entry in descriptions(folder, "experiment")
        ],
        f"Main keys ({syntax}):": [
            (setting.key, _description(setting)) for setting in main_settings(experiment)
        ],
        "Groups of settings (GROUP=NAME):": groups.items(),
        "Options:": OPTIONS,
    }
    listed = {heading: _format_entries(list(entries)) for heading, entries in sections.items()}
    parts = [
        _wrap_text(f"{name}: {experiment.title}.", ""),
        [f"Usage: {name} [+experiment=NAME] [KEY=VALUE ...] [OPTION ...]"],
        *([header] if (header := _header(conf)) else ()),
        *([heading, *lines] for heading, lines in listed.items() if lines),
        _wrap_text(STATUS, ""),
    ]
    return "\n\n".join("\n".join(part) for part in parts)


def main_settings(experiment: Experiment) -> list[Setting]:
    """Return the settings that `--help` lists: dimensions of stores, and settings of the run."""
    listed = [setting for setting in experiment.experiment_settings if setting.role == DIMENSION]
    dims = [setting for setting in listed if setting.fallback is None]
    top_level = [setting for setting in experiment.experiment_settings if "." not in setting.key]
    return [*top_level, *dims, *Zip.declared, *Run.declared, Cluster.kind, Cluster.workers]


def descriptions(conf: Path | None, group: str) -> Iterator[tuple[str, str]]:
    """Yield name and description, the first line of comment, of each file of a group.

    Comments for OmegaConf, such as `# @package`, do not count.
    """
    for path in sorted((conf / group).glob("*.yaml")) if conf is not None else ():
        lines = path.read_text(encoding="utf-8").splitlines()
        comments = (line[1:].strip() for line in lines if line.startswith("#"))
        yield path.stem, next((comment for comment in comments if not comment.startswith("@")), "")


def _header(conf: Path | None) -> list[str]:
    """Return the lines of `hydra.help.header` of a configuration."""
    if conf is None:
        return []
    tree = yaml.safe_load((conf / "config.yaml").read_text(encoding="utf-8"))
    text: str = tree.get("hydra", {}).get("help", {}).get("header", "")
    return text.splitlines()


def _description(setting: Setting) -> str:
    """Return the label of a setting, with its unit and default."""
    unit = f" [{setting.unit}]" if setting.unit != "1" else ""
    return f"{setting.label}{unit}; default {format_value(setting.default_input)}"


def _format_entries(entries: Sequence[tuple[str, str]]) -> list[str]:
    """Return lines of words with texts beside them, or below a long word."""
    short = [len(word) for word, _ in entries if len(word) <= MAX_WORD]
    margin = " " * (max(short, default=0) + len(INDENT) + 2)
    lines = []
    for word, description in entries:
        texts = _wrap_text(description, margin)
        if texts and len(word) <= MAX_WORD:
            texts[0] = f"{INDENT}{word}".ljust(len(margin)) + texts[0].lstrip()
            lines += texts
        else:
            lines += [f"{INDENT}{word}", *texts]
    return lines


def list_settings(experiment: Experiment, words: Sequence[str] = ()) -> str:
    """Return the text of `--settings`: settings with all words in their key or description.

    Lines have at most 79 columns, and no word is broken.

    Raises
    ------
    ConfigurationError
        If no setting has such words.
    """
    lines: list[str] = []
    for setting in (
        entry for declared in experiment.declared for entry in (declared, *declared.kind.entries)
    ):
        text = f"{setting.key} {setting.label} {setting.help}".lower()
        if all(word.lower() in text for word in words):
            unit = f" [{setting.unit}]" if setting.unit != "1" else ""
            null = "null or " if setting.fallback is not None else ""
            axis = f"one value: {setting.not_swept}" if setting.not_swept else "a list is an axis"
            lines += _wrap_text(f"{setting.key}={format_value(setting.default_input)}{unit}", "")
            for paragraph in (setting.label, setting.help, f"{null}{setting.kind.allowed}; {axis}"):
                lines += _wrap_text(paragraph, 2 * INDENT)
    if not lines:
        raise ConfigurationError(f"--settings: no key or description has {' '.join(words)!r}")
    return "\n".join(lines)


def _wrap_text(text: str, margin: str) -> list[str]:
    """Return lines of at most 79 columns, behind a margin, without breaking words."""
    wrapper = textwrap.TextWrapper(WIDTH, break_long_words=False, break_on_hyphens=False)
    wrapper.initial_indent = wrapper.subsequent_indent = margin
    return wrapper.wrap(text)
