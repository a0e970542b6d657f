"""Tables of answers: percent correct by aspect bin, and unknown ships by test vigilance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ncti import evaluate
from sweeps.engine.display import Display, Figure
from sweeps.stages.views import data_set

if TYPE_CHECKING:  # xarray takes a third of a second: it is imported where it is used
    import xarray as xr

VIEW = ("ship", "aspect")
OF_ASPECTS = {"long_name": "whether aspects are learned, lie between, or are drawn at random"}
# Draws of noise, positions and orders, over which accuracies are means.
DRAWS = ("replicate", "ifov_phase", "phase", "order", "draw")
ENDS = ("_ci_low", "_ci_high")


def formed(classified: xr.Dataset, shown: str) -> xr.Dataset:
    """Return the numbers of categories and of views of every training."""
    category = classified.training_category
    columns = {
        "category_count": ((category.max(VIEW) + 1).astype("i4"), "categories formed"),
        "view_count": ((category >= 0).sum(VIEW).astype("i4"), f"training {shown}"),
        "settled": ((classified.passes > 0).astype("i1"), "1 where the categories settled"),
    }
    return data_set(columns)


def tabulate_categories(classified: xr.Dataset) -> xr.Dataset:
    """Return the numbers of categories of all trainings: mean, spread and extremes over draws."""
    arrays = formed(classified, "")
    draws = [name for name in DRAWS if name in arrays["category_count"].dims]
    done = arrays["view_count"] > 0
    counts = arrays["category_count"].where(done)
    views, mean = arrays["view_count"].max(draws), counts.mean(draws)
    settled = done.any(draws) & (arrays["settled"].where(done, 1) == 1).all(draws)
    return data_set(
        {
            "categories": (mean, "categories formed, mean over draws"),
            "spread": (counts.std(draws), "standard deviation of the number of categories"),
            "least": (counts.min(draws), "least number of categories"),
            "most": (counts.max(draws), "largest number of categories"),
            "first": (counts.isel(dict.fromkeys(draws, 0), drop=True), "categories, first draw"),
            "trainings": (done.astype("i4").sum(draws), "number of trainings"),
            "views": (views, "training views"),
            "compression": (views / mean.where(mean > 0), "training views per category"),
            "settled": (settled, "whether no category changed in the last pass"),
        }
    )


def scored(
    correct: xr.DataArray, prefix: str, what: str, aspects: Mapping[str, xr.DataArray] | None = None
) -> xr.Dataset:
    """Return `accuracy`, `ci_low`, `ci_high` and `n` by aspect bin, prefixed, with long names.

    Of (..., ship, aspect) answers: 1 where right, 0 where not, negative where nothing was asked.
    Means over draws have intervals that take in views and draws (`replicated_accuracy`), and a
    `spread`. Answers at `aspects` of several kinds are scored apart, along a dimension of theirs.
    """
    import xarray as xr

    if aspects and len(aspects) > 1:
        parts = [scored(correct.where(kind, -1), prefix, what) for kind in aspects.values()]
        kinds = xr.DataArray(list(aspects), dims="aspects", attrs=OF_ASPECTS, name="aspects")
        return xr.concat(parts, kinds)
    draws = tuple(name for name in DRAWS if name in correct.dims)
    answers = correct.transpose(..., *draws, *VIEW)
    right, asked, aspect = answers.values == 1, answers.values >= 0, answers.aspect.values
    score = evaluate.replicated_accuracy(right, aspect, draws=len(draws), answered=asked)
    figures = {
        "accuracy": (score.fraction, f"fraction of {what} classified correctly"),
        "ci_low": (score.ci_low, "lower end of its 95 % Wilson interval"),
        "ci_high": (score.ci_high, "upper end of its 95 % Wilson interval"),
        "n": (score.n, f"number of {what}"),
    }
    if draws:
        of_draws = evaluate.accuracy_by_aspect(right, aspect, answered=asked).fraction
        spread = xr.DataArray(of_draws, dims=(*answers.dims[:-2], "aspect_bin")).std(draws)
        said = f"standard deviation of that fraction over {' and '.join(draws)}"
        figures["spread"] = spread.values, said
    return by_bin(answers, score.labels, {prefix + name: one for name, one in figures.items()})


def by_bin(
    answers: xr.DataArray, labels: Sequence[str], figures: Mapping[str, tuple[Any, str]]
) -> xr.Dataset:
    """Return (..., aspect_bin) figures of (..., draw, ship, aspect) answers, with their labels."""
    import xarray as xr

    pooled = {name: 0 for name in (*DRAWS, *VIEW) if name in answers.dims}
    cells = answers.isel(pooled, drop=True).expand_dims(aspect_bin=list(labels), axis=-1)
    return data_set(
        {
            name: (xr.DataArray(values, cells.coords, cells.dims), label)
            for name, (values, label) in figures.items()
        }
    )


def tabulate_scores(
    classified: xr.Dataset, aspects: Mapping[str, xr.DataArray], shown: str
) -> xr.Dataset:
    """Return all scores of answers that a classifier gives, by aspect bin.

    With the numbers of categories where they form; tests at aspects of several kinds apart.
    """
    import xarray as xr

    arrays: dict[Any, xr.DataArray] = {}
    if "training_category" in classified:
        arrays |= formed(classified, shown).data_vars.items()
    for name, prefix, what, kinds in (
        ("training_correct", "training_", f"training {shown}", None),
        ("ship_correct", "ship_", f"ships of test {shown}", aspects),
        ("correct", "", f"test {shown}", aspects),
    ):
        if name in classified:
            arrays |= scored(classified[name], prefix, what, kinds).data_vars.items()
    return with_bins(xr.Dataset(arrays), classified.aspect)


def with_bins(table: xr.Dataset, aspect: xr.DataArray) -> xr.Dataset:
    """Return a table with the lowest aspect [deg] of every bin."""
    table.aspect_bin.attrs = {"long_name": "aspects pooled [deg]"}
    _, index = evaluate.aspect_bins(aspect.values)
    lowest = [aspect.values[index == k].min() for k in range(index.max() + 1)]
    about = {"units": "degree", "long_name": "lowest aspect pooled; none of the whole"}
    return table.assign_coords(aspect_low=("aspect_bin", [*lowest, np.nan], about))


# Unknown ships: answers that a test vigilance rejects

AT_ONCE = 2**20  # answers, each at every level of a vigilance, that are held at one time
LEAST = np.array([0.0, 0.5, 0.8, 0.9, 0.95])  # shares of answers to unknown ships, to be rejected
MEANINGS = {
    "rejected_unknown": "fraction of answers to unknown ships that are rejected",
    "rejected_known": "fraction of answers to known ships that are rejected",
    "correct_known": "fraction of answers to known ships that are right and not rejected",
    "n_unknown": "answers to unknown ships",
    "n_known": "answers to known ships",
    "correct_where_rejected": "fraction of answers to known ships that are right and not rejected "
    "where at least so many of those to unknown ones are",
    "rejected_up_to": "largest cosine that must be rejected for that, none where all are accepted",
    "auroc": "probability that an answer to a known ship is more similar than one to an unknown "
    "ship (area under the receiver operating characteristic)",
    "oscr": "probability that an answer to a known ship is right and more similar than one to an "
    "unknown ship (area under the open-set classification rate)",
    "test_vigilance": "cosine that an answer must reach",
    "least_rejected": "fraction of answers to unknown ships that is rejected at least",
}


def tabulate_rejection(
    classified: xr.Dataset,
    known: xr.DataArray,
    aspects: Mapping[str, xr.DataArray],
    test_vigilances: tuple[float, ...],
) -> xr.Dataset:
    """Return the receiver operating characteristic of rejection by test vigilance.

    Of the `similarity` and `correct` of a classifier, (ship,) which it has learned, the others
    being unknown, (aspect,) flags of some kinds by name, and cosines below which a test answers
    "unknown": `MEANINGS` over the classifier's axes and `aspects`, NaN without answers; means over
    all draws, with `..._ci_low` and `..._ci_high`. `correct_where_rejected`,
    `rejected_up_to`, `auroc` and `oscr` are of the whole characteristic, for any test vigilances;
    see `ncti.evaluate.open_set_scores` and `rejection_thresholds`.
    """
    import xarray as xr

    levels = np.array(test_vigilances)
    vigilance = xr.DataArray(levels, {"test_vigilance": levels}, ("test_vigilance",))
    similarity, right = classified.similarity.compute(), classified.correct == 1
    asked = classified.correct >= 0
    pooled = [*(name for name in DRAWS if name in right.dims), *VIEW]
    parts = []
    for kind, of_kind in aspects.items():
        of_known = asked & known & of_kind
        of_unknown = similarity.notnull() & ~known & of_kind  # right or wrong
        of_all = similarity.where(of_known | of_unknown)
        over = partial(xr.apply_ufunc, vectorize=True)
        up_to = over(
            lambda answers: evaluate.rejection_thresholds(answers[~np.isnan(answers)], LEAST),
            similarity.where(of_unknown),
            input_core_dims=[pooled],
            output_core_dims=[["least_rejected"]],
        ).assign_coords(least_rejected=LEAST)
        pools: Any = {"input_core_dims": [pooled] * 3, "output_core_dims": [[], []]}
        auroc, oscr = over(_areas, of_all, right, of_known, **pools)
        part = {
            "n_unknown": of_unknown.sum(pooled),
            "n_known": of_known.sum(pooled),
            "rejected_up_to": up_to.where(up_to > -np.inf).astype(similarity.dtype),
            "auroc": auroc,
            "oscr": oscr,
        }
        for name, level, hits, counted in (
            ("rejected_unknown", vigilance, lambda least: ~(similarity >= least), of_unknown),
            ("rejected_known", vigilance, lambda least: ~(similarity >= least), of_known),
            ("correct_known", vigilance, lambda least: (similarity >= least) & right, of_known),
            ("correct_where_rejected", up_to, lambda most: (similarity > most) & right, of_known),
        ):
            share = _shares(level, hits, counted, name)
            part[name] = share[f"{name}_accuracy"]
            part |= {name + end: share[name + end] for end in ENDS}
        parts.append(xr.Dataset(part).expand_dims(aspects=[kind]))
    table = xr.concat(parts, "aspects")
    for name, meaning in MEANINGS.items():
        table[name].attrs = {"units": "1", "long_name": meaning}
        for ending, end in zip(ENDS, ("lower", "upper"), strict=True):
            if name + ending in table:
                interval = f"{end} end of the 95 % Wilson interval of the {meaning}"
                table[name + ending].attrs = {"units": "1", "long_name": interval}
    table.aspects.attrs = OF_ASPECTS
    return table


def _shares(
    levels: xr.DataArray,
    hits: Callable[[xr.DataArray], xr.DataArray],
    asked: xr.DataArray,
    name: str,
) -> xr.Dataset:
    """Return `scored` of all aspects together at levels, NaN without one.

    Which of the answers asked for are hits is a function of the level. Levels lie on the last axis
    of theirs, and are taken some at a time.
    """
    import xarray as xr

    dim = str(levels.dims[-1])
    some, parts = max(1, AT_ONCE // max(asked.size, 1)), []
    for first in range(0, levels.sizes[dim], some):
        level = levels.isel({dim: slice(first, first + some)})
        hit, counted = xr.broadcast(hits(level), asked & level.notnull())
        # All aspects together, as if they were the same.
        answers = hit.astype("i1").where(counted, np.int8(-1))
        answers = answers.assign_coords(aspect=np.zeros(hit.sizes["aspect"]))
        parts.append(scored(answers, f"{name}_", name).sel(aspect_bin="overall", drop=True))
    return xr.concat(parts, dim) if len(parts) > 1 else parts[0]


def _areas(similarity: Any, right: Any, known: Any) -> tuple[float, float]:
    """Return AUROC and OSCR of answers, NaN without any; a similarity of NaN is none."""
    asked = ~np.isnan(similarity)
    scores = evaluate.open_set_scores(similarity[asked], right[asked], known[asked])
    return scores.auroc, scores.oscr


# How tables of answers are shown

_percent = partial(Figure, percent=True, format=".0f")


def score_displays(
    labels: Mapping[str, str], *, scored: str, source: str, chance: tuple[Any, Any]
) -> tuple[Display, ...]:
    """Return the displays of percent correct of one classifier, of its training views, too.

    `labels` tell it from others, `scored` says what has to be right. `chance` is percent correct of
    random answers of that kind, and of ships.
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
    names = ("first", "least", "most", "trainings", "views", "settled")
    return Display(
        "categories",
        "Categories formed in training",
        (
            Figure("categories", beside={"spread": "spread"}, digits=2),
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
        low, high = (variable + end for end in ENDS)
        return _percent(variable, name, low, high, {one: one for one in beside})

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
        columns="least_rejected",
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
