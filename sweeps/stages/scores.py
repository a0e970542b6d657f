"""Displays of answers: percent correct by aspect bin, categories, rejection of unknown ships."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from ncti.evaluate.rejection import INTERVAL_SUFFIXES
from sweeps.engine.declare.display import Display, Figure

_percent = partial(Figure, percent=True, format=".0f")


def score_displays(
    labels: Mapping[str, str], *, scored: str, source: str, chance: tuple[Any, Any]
) -> tuple[Display, ...]:
    """Return the displays of percent correct of one classifier, including its training views.

    `labels` distinguish it from others, `scored` names the rule of a right answer. `chance` is
    percent correct of random answers by that rule, and by ship.
    """

    def figure(prefix: str) -> Figure:
        accuracy, low, high, spread, n = (
            prefix + name for name in ("accuracy", "ci_low", "ci_high", "spread", "n")
        )
        return _percent(accuracy, "percent_correct", low, high, {"spread": spread, "n": n})

    return tuple(
        Display(
            "scores",
            "Ships identified correctly [%]",
            (figure(prefix),),
            rows=("classifier", "channel", "scored"),
            columns="aspect_bin",
            labels={**labels, "scored": right, "kind": kind},
            source=of_source,
            chance=level,
            notes=(
                "With 95 % Wilson intervals. n counts answers; those that are alike for one view, "
                "or in one draw, count for less (Kish's design effect).",
            ),
        )
        for prefix, right, kind, of_source, level in (
            ("", scored, "test", source, chance[0]),
            ("ship_", "ship", "test", "", chance[1]),
            ("training_", scored, "training", source, chance[0]),
        )
    )


def category_display(labels: Mapping[str, str], source: str) -> Display:
    """Return the display of the numbers of categories that one classifier forms."""
    names = ("first", "minimum", "maximum", "trainings", "views", "settled")
    return Display(
        "categories",
        "Categories formed in training",
        (
            Figure("categories", extra_columns={"spread": "spread"}, digits=2),
            Figure("compression", digits=2, listed=False),
            *(Figure(name, listed=name == "views") for name in names),
        ),
        rows=("classifier", "channel"),
        columns="vigilance",
        labels=labels,
        source=source,
        notes=("Means over draws of noise, positions and orders of presentation.",),
    )


def rejection_displays(labels: Mapping[str, str]) -> tuple[Display, Display]:
    """Return the displays of the rejection of unknown ships: its curve, and by test vigilance."""

    def share(variable: str, name: str, *beside: str) -> Figure:
        low, high = (variable + end for end in INTERVAL_SUFFIXES)
        return _percent(variable, name, low, high, {column: column for column in beside})

    curve = Display(
        "rejection_curve",
        "Known ships identified correctly [%], by share of unknown ships rejected",
        (
            share("correct_where_rejected", "percent_correct", "n_known", "n_unknown"),
            Figure("auroc", digits=3, format=".2f"),
            Figure("oscr", digits=3, format=".2f"),
            Figure("rejected_up_to", listed=False),
        ),
        rows=("classifier", "channel"),
        columns="min_rejected",
        labels=labels,
        notes=(
            "At the least test vigilance that rejects at least that share. auroc, oscr: areas "
            "under the curves of known ships accepted, and of those accepted and identified, over "
            "unknown ships accepted; by chance 0.5 and half the accuracy.",
        ),
    )
    rates = Display(
        "rejection",
        "Ships rejected and identified correctly [%], by test vigilance",
        (
            share("rejected_unknown", "percent_rejected_unknown", "n_known", "n_unknown"),
            share("rejected_known", "percent_rejected_known"),
            share("correct_known", "percent_correct_known"),
        ),
        rows=("classifier", "channel"),
        labels=labels,
    )
    return curve, rates
