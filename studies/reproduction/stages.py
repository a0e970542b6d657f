"""The article's Tables 2 to 5 over its unstated parameters: settings drawn, fitted and judged."""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import article
from ncti.labels import labelled_dataset
from studies.reproduction.assumptions import PRIORS, assumed
from studies.reproduction.fits import FITS, Agreement
from studies.reproduction.setting import draw, reproduce
from sweeps.engine.declare.display import Display, Figure
from sweeps.engine.declare.settings import Choices, Run, Settings, count, draws
from sweeps.engine.declare.stage import Group, Output, Stream, coordinate
from sweeps.stages import meshes, views
from sweeps.stages.refusals import refuse
from sweeps.stages.ships import ship_name
from sweeps.stages.views import Arrays, Grid, uses_sensor

if TYPE_CHECKING:
    import xarray as xr

    from ncti.render import LineImage

SENSOR = "reproduce"
CONF = Path(__file__).with_name("conf")
IMPORTS = ("ncti.classify.adaptive_clustering", "ncti.classify.gain_annealed", "scipy.stats.qmc")
ENDS = (0.025, 0.975)  # of a posterior
JUDGED = (2, 3, 4, 5)  # tables of the article
FIGURE_COLUMNS = ("article", "least", "largest", "agreeing", "nearest")
CACHED_VIEWS = 5000  # views: 31 of 36 ships and variants at four depressions, some 1.1 GB
VARIABLES = ("mean", "spread", "value")


class Reproduce(Settings, key="reproduce"):
    """Settings of the article's unstated parameters."""

    setting = draws(
        2000,
        10**6,
        label="setting of what the article leaves open, by number",
        role="dimension",
    )
    draws = count(
        3, 2, 1000, label="draws of the noise in a setting", not_swept="tables are means over them"
    )


SETTINGS = Group(
    "reproduction",
    uses_sensor(SENSOR),
    (Grid, Reproduce, Run),
    status=views.Status("setting", "state of the settings", (Reproduce.setting,)),
)


@SETTINGS.stage(
    Output("mean", ("figure",), "f8", "figure of the article, simulated: mean over draws"),
    Output("spread", ("figure",), "f8", "standard deviation of a single draw"),
    Output("value", ("parameter",), "f8", "value of a parameter; of words, their number"),
    gather=(Grid.aspect,),
    stream=Stream((Reproduce.setting,)),
)
def reproduced(
    mesh_sources: tuple[meshes.MeshSource, ...],
    aspect: tuple[float, ...],
    setting: int,
    draws: int,
    seed: int,
    rng: np.random.Generator,
) -> Arrays:
    """Return the article's figures and all parameters in one setting."""
    values = assumed(setting, seed=seed)
    tables = reproduce(values, aspects=aspect, draws=draws, rng=rng, view=_draw_view)
    numbers = [prior.number(values[name]) for name, prior in PRIORS.items()]
    return {
        "mean": article.figure_order({name: scores.mean for name, scores in tables.items()}),
        "spread": article.figure_order({name: scores.spread for name, scores in tables.items()}),
        "value": np.array(numbers),
    }


@lru_cache(maxsize=CACHED_VIEWS)
def _draw_view(ship: str, aspect: float, depression: float) -> LineImage:
    mesh = meshes.read_mesh(meshes.mesh_source(ship_name(ship)))
    return draw(mesh, aspect, depression)


@SETTINGS.stage(
    coordinate("parameter", ("parameter",), "U32", "parameter that the article leaves open")
)
def parameter_names() -> NDArray[np.str_]:
    """Return the names of all parameters."""
    return np.array(list(PRIORS))


@SETTINGS.stage(
    coordinate("figure", ("figure",), "U48", "figure of the article"),
    gather=(Grid.aspect,),
)
def figure_names(aspect: tuple[float, ...]) -> NDArray[np.str_]:
    """Return the names of the article's figures."""
    return np.array([f"Table {figure.table}, {figure.name}" for figure in article.figures(aspect)])


def check(choices: Choices) -> None:
    """Refuse (`ConfigurationError`) ships and aspects that the article's tables do not cover."""
    if uses_sensor(SENSOR)(choices):
        ships, aspects = choices[Grid.ship], choices[Grid.aspect]
        if tuple(map(str, ships)) != article.SHIPS:
            refuse(Grid.ship, list(map(str, ships)), f"the article's {', '.join(article.SHIPS)}")
        try:
            article.figures(aspects)
        except ValueError as error:
            refuse(Grid.aspect, list(aspects), f"such that {error}")


def valid_settings(reproduction: xr.Dataset, choices: Choices) -> tuple[xr.DataArray, Agreement]:
    """Return the settings of a group that did not fail, and their agreement with the article."""
    complete = np.flatnonzero(reproduction["mean"].notnull().all("figure"))
    settings = reproduction.isel(setting=complete).transpose("setting", ...)
    figures, draws = article.figures(choices[Grid.aspect]), choices.value(Reproduce.draws)
    arrays = {name: settings[name].values for name in VARIABLES}
    return settings.setting, Agreement(figures, draws=draws, **arrays)


def tabulate_figures(reproduction: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the article's figures beside those of settings, by the tables these are fitted to."""
    _, settings = valid_settings(reproduction, choices)
    fits, reach = settings.fits.values(), settings.reach
    fit_dims, dims = ("fitted", "figure"), ("figure",)
    low, high = np.stack([fit.quantiles(settings.mean, ENDS) for fit in fits], axis=1)
    columns = {
        "percent": ((fit_dims, [fit.mean(settings.mean) for fit in fits]), "mean of the posterior"),
        "percent_low": ((fit_dims, low), "2.5 % quantile of the posterior"),
        "percent_high": ((fit_dims, high), "97.5 % quantile of the posterior"),
        "article": ((dims, settings.article), "the article's figure"),
        "least": ((dims, reach.low), "least of all settings"),
        "largest": ((dims, reach.high), "largest of all settings"),
        "agreeing": ((dims, reach.share), "share of settings within two standard deviations"),
        "nearest": ((dims, reach.nearest), "standard deviations that the nearest setting is off"),
    }
    return _labelled_columns(columns, reproduction)


def tabulate_parameters(reproduction: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return quantiles of the posterior of each parameter, and its information on the prior."""
    _, settings = valid_settings(reproduction, choices)
    fits = settings.fits.values()
    fit_dims = ("fitted", "parameter")
    low, median, high = np.stack(
        [fit.quantiles(settings.value, (ENDS[0], 0.5, ENDS[1])) for fit in fits], axis=1
    )
    columns = {
        "median": ((fit_dims, median), "median of the posterior; of words, their number"),
        "median_low": ((fit_dims, low), "2.5 % quantile of the posterior"),
        "median_high": ((fit_dims, high), "97.5 % quantile of the posterior"),
        "information": (
            (fit_dims, [settings.information(fit) for fit in fits]),
            "information of the posterior on the prior",
            "bit",
        ),
    }
    return _labelled_columns(columns, reproduction)


def tabulate_fits(reproduction: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the distance to each table, by the tables that settings are fitted to."""
    numbers, settings = valid_settings(reproduction, choices)
    fits = settings.fits.values()
    distances = np.transpose(
        [settings.distance((table,)) / settings.table_mask((table,)).sum() for table in JUDGED]
    )
    fit_dims, dims = ("fitted", "table"), ("fitted",)
    best = [distances[fit.weight.argmax()] for fit in fits]
    columns = {
        "distance": (
            (fit_dims, [fit.mean(distances) for fit in fits]),
            "chi-square per figure, mean",
        ),
        "best": ((fit_dims, best), "chi-square per figure of the setting of the largest weight"),
        "least": (
            (("table",), distances.min(axis=0)),
            "least chi-square per figure of all settings",
        ),
        "temperature": ((dims, [fit.temperature for fit in fits]), "factor of all variances"),
        "together": (((), settings.reach.together.max()), "figures that one setting agrees with"),
        "weight": ((("fitted", "setting"), [fit.weight for fit in fits]), "weight of a setting"),
        "effective": ((dims, [fit.effective for fit in fits]), "effective number of settings"),
    }
    table = _labelled_columns(columns, reproduction)
    return table.assign_coords(table=list(JUDGED), setting=numbers)


def _labelled_columns(columns: dict[str, Any], reproduction: xr.Dataset) -> xr.Dataset:
    """Return columns as a data set, with the names of fits, figures and parameters."""
    import xarray as xr

    table = labelled_dataset(
        {name: (xr.Variable(*variable), *label) for name, (variable, *label) in columns.items()}
    )
    names: dict[Any, Any] = {
        name: reproduction[name] for name in ("figure", "parameter") if name in table.dims
    }
    return table.assign_coords(names | {"fitted": list(FITS)})


_shown = partial(Figure, format=".0f")
STAGES = (
    reproduced,
    parameter_names,
    figure_names,
)
TABLES = (
    SETTINGS.table(
        "reproduction",
        tabulate_figures,
        Display(
            "reproduction",
            "The article's figures, by the tables that settings are fitted to",
            (_shown("percent"), *(_shown(name, listed=False) for name in FIGURE_COLUMNS)),
            rows=("figure",),
            columns="fitted",
            notes=("Percent correct, or categories, with the middle 95 % of the posterior.",),
        ),
    ),
    SETTINGS.table(
        "reproduction_parameters",
        tabulate_parameters,
        Display(
            "reproduction_parameters",
            "Information of the posterior on each parameter [bit]",
            (Figure("information", format=".2f"), Figure("median", listed=False)),
            rows=("parameter",),
            columns="fitted",
        ),
    ),
    SETTINGS.table(
        "reproduction_fits",
        tabulate_fits,
        Display(
            "reproduction_fits",
            "Chi-square per figure of each table, by the tables that settings are fitted to",
            (
                Figure("distance", format=".1f"),
                *(Figure(name, listed=False) for name in ("best", "least", "temperature")),
                Figure("effective", listed=False),
            ),
            rows=("fitted",),
            columns="table",
        ),
    ),
)
