"""Every figure of README.md and docs/results.md: means over seeds, with their intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from benchmarks.budget import write
from benchmarks.repeated import WORKERS, listed, swept, swept_by_seed
from benchmarks.reports import Report
from benchmarks.result_tables import (
    GROUPS,
    STEP,
    Answers,
    categories,
    fusion,
    new_aspects,
    prior_knowledge,
    protocol,
    unknown,
    with_known,
)
from sweeps.engine.cluster import ClusterChoice

ROOT = Path(__file__).resolve().parent.parent
README, PAGE = ROOT / "README.md", ROOT / "docs" / "results.md"
SEEDS, LEAST_SEEDS = 20, 2
CLASSIFIERS = ("acn", "correlation", "likelihood")

LEARNED = tuple(np.arange(0.0, 90.1, STEP).tolist())
FRESH = 10
SOURCE_STEP = 3
BOTH = ("sensor=both", "grid.frame_count=16", "infrared.frame_count=16", "infrared.vigilance=0.87")
NEW = (
    *(*BOTH, "grid.range=[25,50,100]", "infrared.range=[25,50,100]"),
    *("infrared.super_resolution=none", "classifier.template_spacing=[1.5,3,6]"),
    "classifier.name=[acn,correlation,likelihood,fusion]",
)
SHIFTED = (
    *(*BOTH, "grid.range=100", "infrared.range=100", "infrared.super_resolution=shifted"),
    *("classifier.template_spacing=[1.5,3,6]", "classifier.name=fusion"),
)
KNOWN = (
    *("grid.frame_count=16", "classifier.name=likelihood"),
    *("classifier.gain_sigma=[0,1]", "classifier.floor_sigma=[0,1]"),
)
PROTOCOL = (
    *("+experiment=draws", "grid.pulse_width=30", "grid.vigilance=0.95", "ladar.phases=2"),
    *("classifier.orders=4", "infrared.phases=2", "infrared.orders=4"),
    "classifier.name=[acn,mnn,correlation,likelihood]",
)
FORMED = (
    *("grid.pulse_width=[10,30,50]", "grid.frame_count=16", "classifier.orders=8"),
    "classifier.name=acn",
)
UNKNOWN = (
    *("grid.ship=[duncan,horne,spruance,texas,connole,roberts]", "grid.frame_count=16"),
    *("classifier.unknown=[connole,roberts]", "classifier.name=[acn,correlation,likelihood]"),
    "classifier.template_spacing=3",
)

PARTS = ("new", "known", "protocol", "categories", "unknown")


@dataclass(frozen=True)
class Sizes:
    """Sizes of the sweeps: as published, or smaller for a test.

    Attributes
    ----------
    seeds : int
        Number of seeds, at least two.
    more : tuple of str
        Arguments of `ncti-sweep` that are added to every sweep.
    learned : tuple of float
        Learned aspects, multiples of `STEP` [deg].
    fresh : int
        Number of random aspects of a seed in every 30 degrees.
    parts : tuple of str
        Names of the parts of `PARTS` that are made; all if empty.
    workers : ClusterChoice
        Where cells are computed.
    """

    seeds: int
    more: tuple[str, ...] = ()
    learned: tuple[float, ...] = LEARNED
    fresh: int = FRESH
    parts: tuple[str, ...] = ()
    workers: ClusterChoice = WORKERS


def in_group(group: str, *names: str) -> tuple[str, ...]:
    """Return the names of groups of a store that begin alike."""
    return tuple(group + name for name in names)


def begin(name: str) -> str:
    """Return the line of a page after which a table is written."""
    return f"<!-- begin: python -m benchmarks results --write ({name}) -->"


def name_of_page(name: str) -> Path:
    """Return the page that has a table."""
    return README if name == "summary" else PAGE


def measure(sizes: Sizes) -> dict[str, Report]:
    """Return the tables by name, after the sweeps that they need."""
    parts, seeds, more = sizes.parts or PARTS, sizes.seeds, sizes.more

    def alone(overrides: Sequence[str], groups: Sequence[str], label: str) -> dict[str, xr.Dataset]:
        """Return groups of one sweep with all seeds as an axis, at the source's aspects."""
        source = [one for one in sizes.learned if one % SOURCE_STEP == 0]
        axes = [f"seed={listed(range(seeds))}", f"grid.aspect={listed(source)}"]
        return swept([*overrides, *axes, *more], groups, label=label, workers=sizes.workers)

    def each(overrides: Sequence[str], groups: Sequence[str], label: str) -> Answers:
        """Return groups of a sweep with the random aspects of all seeds."""
        return swept_by_seed(
            *([*overrides, *more], groups),
            seeds=seeds,
            learned=sizes.learned,
            fresh=sizes.fresh,
            label=label,
            workers=sizes.workers,
        )

    made: dict[str, Report] = {}
    if "new" in parts:
        answers = each(NEW, GROUPS, "new aspects")
        shifted = each(SHIFTED, in_group("classification/", "fusion"), "shifted frames")
        made |= new_aspects(answers) | {"fusion": fusion(answers, shifted)}
    if "known" in parts:
        groups = in_group("classification/", "likelihood")
        made |= prior_knowledge(each(KNOWN, groups, "known gain and floor"))
    if "summary" in made and "known" in made:
        made["summary"] = with_known(made["summary"], made["known"])
    if "protocol" in parts:
        groups = in_group("classification/", *CLASSIFIERS, "mnn", "acn_infrared")
        made |= protocol(alone(PROTOCOL, groups, "the source's protocol"))
    if "categories" in parts:
        made |= categories(alone(FORMED, in_group("classification/", "acn"), "categories"))
    if "unknown" in parts:
        groups = in_group("classification/", *CLASSIFIERS)
        made |= unknown(each(UNKNOWN, groups, "unknown ships"))
    return made


def write_all(reports: Mapping[str, Report], pages: Callable[[str], Path] = name_of_page) -> None:
    """Write tables into their pages, between marker lines."""
    for name, report in reports.items():
        write(report, pages(name), begin(name))
