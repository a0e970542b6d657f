"""Settings have the article's values, read from `article.yaml` or worked out from it.

`docs/tables/settings.csv` has all other defaults, and `test_declarations` compares it with them.
"""

import inspect

import pytest
from commands import chosen

from ncti import infrared, ladar
from ncti.article import article_figures
from ncti.classify import AdaptiveClusteringNetwork, GainAnnealedNetwork
from sweeps.experiment import EXPERIMENT

SOURCE = article_figures()
PROFILES, SILHOUETTES = SOURCE["table4_percent_correct"], SOURCE["table5_percent_correct"]
FOOT = 0.3048  # [m], exact
ALTITUDE = 22_000 * FOOT
RANGES = tuple(SOURCE["table1_sensor"]["ranges"])

PUBLISHED = {
    "grid.pulse_width": (PROFILES["pulse_width"],),
    "grid.frame_count": tuple(sorted(PROFILES["frames"])),
    "grid.range": (SOURCE["experiment"]["range"],),
    "grid.vigilance": (PROFILES["vigilance"],),
    "scene.depression": (3.84,),  # 22,000 ft at 100 km, over a flat sea
    "scene.altitude": (ALTITUDE,),
    "ladar.cnr_range": (SOURCE["experiment"]["range"],),
    "ladar.receiver": (SOURCE["experiment"]["receiver"],),
    "infrared.training_range": (RANGES[0],),
}


def values_of(choices, key):
    (setting,) = (declared for declared in EXPERIMENT.declared if declared.key == key)
    return choices.values[setting.key]


@pytest.mark.parametrize("key", PUBLISHED)
def test_defaults_match_the_article(key):
    values = values_of(chosen(), key)
    assert (values if isinstance(values, tuple) else (values,)) == PUBLISHED[key]


def test_paper_experiments_match_the_article():
    paper = chosen("+experiment=paper")
    assert values_of(paper, "sensor") == (("infrared", "range"),)
    assert values_of(paper, "grid.ship") == ("duncan", "horne", "spruance", "texas")
    assert values_of(paper, "grid.aspect") == tuple(range(0, 91, 3))
    assert values_of(paper, "grid.frame_count") == PUBLISHED["grid.frame_count"]
    assert values_of(paper, "grid.range") == PUBLISHED["grid.range"]
    assert values_of(paper, "grid.pulse_width") == tuple(SOURCE["table3_categories"]["categories"])
    assert SOURCE["table3_categories"]["vigilance"] in values_of(paper, "grid.vigilance")
    assert values_of(paper, "infrared.vigilance") == (SILHOUETTES["vigilance"],)
    assert values_of(paper, "infrared.frame_count") == (SILHOUETTES["frame_count"],)
    assert values_of(paper, "infrared.range") == RANGES
    views = len(values_of(paper, "grid.ship")) * len(values_of(paper, "grid.aspect"))
    assert views == SOURCE["experiment"]["views"]
    assert values_of(chosen("+experiment=table5"), "grid.vigilance") == (SILHOUETTES["vigilance"],)


@pytest.mark.parametrize("name", ["smoke", "paper", "draws", "table2", "table4"])
def test_article_experiments_place_ships_at_an_ifov_corner(name):
    choices = chosen(f"+experiment={name}")
    assert values_of(choices, "ladar.place") == ("corner",)
    if "likelihood" in values_of(choices, "classifier.name"):
        assert values_of(choices, "classifier.template_places") == (0,)  # by number
    assert values_of(chosen("+experiment=fresh"), "ladar.place") == ("random",)


def test_library_defaults_match_the_article():
    def default(function, name):
        return inspect.signature(function).parameters[name].default

    assert default(ladar.carrier_to_noise, "reference") == 10 ** (32 / 10)
    assert default(ladar.carrier_to_noise, "reference_range") == 100e3
    assert default(ladar.range_extent, "ifov") == infrared.IFOV == 150e-6
    assert default(ladar.range_extent, "bin_width") == 1
    assert default(ladar.range_extent, "window") == 250
    assert default(ladar.range_extent, "spread") == 0.5
    assert AdaptiveClusteringNetwork().learning_rate == 0.1
    assert GainAnnealedNetwork().max_hidden == 25
    assert pytest.approx(infrared.EXTINCTION * 1e6) == 181
