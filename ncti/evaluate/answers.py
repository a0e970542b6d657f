"""Tables of answers in data sets: percent correct by aspect bin, and numbers of categories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ncti.evaluate.replicates import replicated_accuracy
from ncti.evaluate.scores import accuracy_by_aspect, aspect_bins
from ncti.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

VIEW = ("ship", "aspect")
ASPECT_ATTRS = {"long_name": "whether aspects are learned, lie between, or are drawn at random"}
# Draws of noise, positions and orders, over which accuracies are means.
DRAWS = ("replicate", "phase", "order", "draw")


def count_categories(classified: xr.Dataset, noun: str) -> xr.Dataset:
    """Return the number of categories and of views of every training."""
    category = classified.training_category
    columns = {
        "category_count": ((category.max(VIEW) + 1).astype("i4"), "categories formed"),
        "view_count": ((category >= 0).sum(VIEW).astype("i4"), f"training {noun}"),
        "settled": ((classified.passes > 0).astype("i1"), "1 where the categories settled"),
    }
    return labelled_dataset(columns)


def tabulate_categories(classified: xr.Dataset) -> xr.Dataset:
    """Return the numbers of categories of all trainings: mean, spread and extremes over draws.

    Parameters
    ----------
    classified : xarray.Dataset
        `training_category`, categories of training views over ship, aspect and others, negative
        outside training; `passes`, presentations of the training set, negative where the
        categories did not settle.

    Returns
    -------
    xarray.Dataset
        `categories`, their mean over the draws of `DRAWS`, with `spread`, `minimum`, `maximum`
        and `first`; `trainings`, `views`, `compression` (views per category) and `settled`.

    See Also
    --------
    tabulate_scores : Percent correct, and the number of categories of every training.

    Examples
    --------
    >>> import xarray as xr
    >>> from ncti.evaluate import tabulate_categories
    >>> category = xr.DataArray([[[0, 1], [2, 2]], [[0, 0], [1, 1]]], dims=("order", *VIEW))
    >>> passes = xr.DataArray([3, 4], dims="order")
    >>> table = tabulate_categories(xr.Dataset({"training_category": category, "passes": passes}))
    >>> float(table.categories), float(table.compression), bool(table.settled)
    (2.5, 1.6, True)
    """
    arrays = count_categories(classified, "")
    draws = [name for name in DRAWS if name in arrays["category_count"].dims]
    trained = arrays["view_count"] > 0
    counts = arrays["category_count"].where(trained)
    views, mean = arrays["view_count"].max(draws), counts.mean(draws)
    settled = trained.any(draws) & (arrays["settled"].where(trained, 1) == 1).all(draws)
    return labelled_dataset(
        {
            "categories": (mean, "categories formed, mean over draws"),
            "spread": (counts.std(draws), "standard deviation of the number of categories"),
            "minimum": (counts.min(draws), "smallest number of categories"),
            "maximum": (counts.max(draws), "largest number of categories"),
            "first": (counts.isel(dict.fromkeys(draws, 0), drop=True), "categories, first draw"),
            "trainings": (trained.astype("i4").sum(draws), "number of trainings"),
            "views": (views, "training views"),
            "compression": (views / mean.where(mean > 0), "training views per category"),
            "settled": (settled, "whether no category changed in the last pass"),
        }
    )


def accuracy_columns(
    correct: xr.DataArray, prefix: str, noun: str, aspects: Mapping[str, xr.DataArray] | None = None
) -> xr.Dataset:
    """Return `accuracy`, `ci_low`, `ci_high` and `n` by aspect bin, prefixed, with long names.

    Answers (..., ship, aspect) are 1 if right, 0 if wrong, and negative if there is none.
    For means over draws, intervals account for views and draws (`replicated_accuracy`), and
    `spread` is added. Several kinds of `aspects` are scored separately, along a dimension of kinds.
    """
    import xarray as xr

    if aspects and len(aspects) > 1:
        parts = [
            accuracy_columns(correct.where(kind, -1), prefix, noun) for kind in aspects.values()
        ]
        kinds = xr.DataArray(list(aspects), dims="aspects", attrs=ASPECT_ATTRS, name="aspects")
        return xr.concat(parts, kinds)
    draws = tuple(name for name in DRAWS if name in correct.dims)
    answers = correct.transpose(..., *draws, *VIEW)
    right, answered, aspect = answers.values == 1, answers.values >= 0, answers.aspect.values
    score = replicated_accuracy(right, aspect, draws=len(draws), answered=answered)
    figures = {
        "accuracy": (score.fraction, f"fraction of {noun} classified correctly"),
        "ci_low": (score.ci_low, "lower end of its 95 % Wilson interval"),
        "ci_high": (score.ci_high, "upper end of its 95 % Wilson interval"),
        "n": (score.n, f"number of {noun}"),
    }
    if draws:
        by_draw = accuracy_by_aspect(right, aspect, answered=answered).fraction
        spread = xr.DataArray(by_draw, dims=(*answers.dims[:-2], "aspect_bin")).std(draws)
        label = f"standard deviation of that fraction over {' and '.join(draws)}"
        figures["spread"] = spread.values, label
    prefixed = {prefix + name: figure for name, figure in figures.items()}
    return label_bins(answers, score.labels, prefixed)


def label_bins(
    answers: xr.DataArray, labels: Sequence[str], figures: Mapping[str, tuple[Any, str]]
) -> xr.Dataset:
    """Return (..., aspect_bin) figures with labels, on the axes of (..., draw, ship, aspect)."""
    import xarray as xr

    pooled = {name: 0 for name in (*DRAWS, *VIEW) if name in answers.dims}
    cells = answers.isel(pooled, drop=True).expand_dims(aspect_bin=list(labels), axis=-1)
    return labelled_dataset(
        {
            name: (xr.DataArray(values, cells.coords, cells.dims), label)
            for name, (values, label) in figures.items()
        }
    )


def tabulate_scores(
    classified: xr.Dataset, aspects: Mapping[str, xr.DataArray], shown: str
) -> xr.Dataset:
    """Return all scores of answers that a classifier gives, by aspect bin.

    Parameters
    ----------
    classified : xarray.Dataset
        Over ship, aspect and others: `correct`, and perhaps `ship_correct` and
        `training_correct`, 1 where right, 0 where wrong, negative where there is no answer;
        optionally `training_category` and `passes`, as of `tabulate_categories`.
    aspects : mapping of str to (aspect,) xarray.DataArray of bool
        Kinds of aspects, whose tests are scored apart if there are several.
    shown : str
        Noun of the classified samples, for labels.

    Returns
    -------
    xarray.Dataset
        `accuracy`, `ci_low`, `ci_high` (95 % Wilson intervals that take in views and the draws of
        `DRAWS`), `n` and, of several draws, `spread`, by `aspect_bin`; those of ships and of
        training with the prefixes `ship_` and `training_`.

    See Also
    --------
    replicated_accuracy : Intervals of means over draws.
    tabulate_rejection : Rejection of unknown ships.

    Examples
    --------
    Two ships at three aspects, of which the last is not there:

    >>> import xarray as xr
    >>> from ncti.evaluate import tabulate_scores
    >>> correct = xr.DataArray([[1, 0, -1], [1, 1, -1]], {"aspect": [0.0, 15.0, 60.0]}, VIEW)
    >>> table = tabulate_scores(xr.Dataset({"correct": correct}), {}, "profiles")
    >>> table.accuracy.sel(aspect_bin="overall").item(), table.n.values.tolist()
    (0.75, [4, 0, 4])
    """
    import xarray as xr

    arrays: dict[Any, xr.DataArray] = {}
    if "training_category" in classified:
        arrays |= count_categories(classified, shown).data_vars.items()
    for name, prefix, noun, kinds in (
        ("training_correct", "training_", f"training {shown}", None),
        ("ship_correct", "ship_", f"ships of test {shown}", aspects),
        ("correct", "", f"test {shown}", aspects),
    ):
        if name in classified:
            arrays |= accuracy_columns(classified[name], prefix, noun, kinds).data_vars.items()
    return add_bin_attribute(xr.Dataset(arrays), classified.aspect)


def add_bin_attribute(table: xr.Dataset, aspect: xr.DataArray) -> xr.Dataset:
    """Return a table with the lowest aspect [deg] of each bin as an attribute."""
    _, index = aspect_bins(aspect.values)
    lowest = [float(aspect.values[index == k].min()) for k in range(index.max() + 1)]
    table.aspect_bin.attrs = {"long_name": "aspects pooled [deg]", "aspect_low": lowest}
    return table
