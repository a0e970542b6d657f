"""The settings that published figures were made with, each with where it comes from.

A default that changes by accident changes every table of the README, and no other test says so.
Where the source prints a number, it is read from `source_figures.yaml`, or worked out from numbers
printed there.
"""

import inspect
import math

import numpy as np
import pytest
from commands import chosen

from ncti import infrared, ladar
from ncti.classify import AdaptiveClusteringNetwork, GainAnnealedNetwork
from ncti.render.flight import depression_angle
from sweeps.experiment import EXPERIMENT
from sweeps.report.beside import source_figures

SOURCE = source_figures()
PROFILES, SILHOUETTES = SOURCE["table4_percent_correct"], SOURCE["table5_percent_correct"]
FOOT = 0.3048  # [m], exact
ALTITUDE = 22_000 * FOOT
RANGES = tuple(SOURCE["table1_sensor"]["ranges"])
OURS, FITTED, ASSUMED = "ours: ", "fitted: ", "assumed: "

PUBLISHED = {
    "grid.ship": (("duncan", "horne", "spruance", "texas"), "source, its four models"),
    "grid.aspect": (tuple(range(0, 91, 3)), "source, 31 aspects in steps of 3 deg"),
    "grid.pulse_width": ((PROFILES["pulse_width"],), "source, Table 4"),
    "grid.frame_count": (tuple(sorted(PROFILES["frames"])), "source, Table 4"),
    "grid.range": ((SOURCE["experiment"]["range"],), "source, Table 4"),
    "grid.vigilance": ((PROFILES["vigilance"],), "source, Table 4"),
    "grid.replicate": ((0,), OURS + "experiments with intervals over draws ask for more"),
    "grid.random_aspects": ((0,), "source: tests are at the aspects learned"),
    "scene.geometry": (("fixed",), "source: one set of renderings for every range"),
    "scene.depression": ((3.84,), "source: 22,000 ft at 100 km, over a flat sea"),
    "scene.altitude": ((ALTITUDE,), "source: 22,000 ft"),
    "scene.earth_radius": ((6_371_000,), "mean radius of the Earth"),
    "render.pixel": ((0.25,), "source: 0.25 m on the target"),
    "render.tolerance": ((None,), OURS + "the source has pixels"),
    "render.samples": ((20_000,), OURS + "docs/error_budget.md"),
    "ladar.ifov": ((150,), "source, 'NCTI Sensor Suite'"),
    "ladar.bin_width": ((1,), "source, Appendix 1"),
    "ladar.window": ((250,), OURS + "holds the longest ship end on, both edges free"),
    "ladar.spread": ((0.5,), OURS + "errs least against exact extents, tests/convergence"),
    "ladar.reflectance": (("projected_area",), "source, Appendix 1"),
    "ladar.cnr": ((32,), "source, 'NCTI Sensor Suite'"),
    "ladar.cnr_range": ((SOURCE["experiment"]["range"],), "source, 'NCTI Sensor Suite'"),
    "ladar.extinction": ((0,), "source: its 32 dB contain it"),
    "ladar.target_free_ifovs": ((4000,), FITTED + "to Table 2, bow, 32 to 4 frames"),
    "ladar.receiver": ((SOURCE["experiment"]["receiver"],), "source, Appendix 1"),
    "ladar.false_alarm": ((1e-6,), ASSUMED + "of first-pulse receivers only"),
    "infrared.ifov": ((150,), "source, 'NCTI Sensor Suite'"),
    "infrared.contrast_at_zero": ((2.1585,), "source, Table 1: 58.0 at 50 km, through 9.05 dB"),
    "infrared.extinction": ((0.181,), "source, Table 1: 18.1 dB at 100 km"),
    "infrared.nedt": ((0.4,), "source, Table 1: 0.27 K at an SNR of 7.2 by 16 frames"),
    "infrared.target_spread": ((0.1,), ASSUMED + "measured by the source, not printed"),
    "infrared.sea_spread": ((0.1,), ASSUMED + "measured by the source, not printed"),
    "infrared.false_alarm": ((1e-6,), ASSUMED + "of the detector only"),
    "infrared.coverage_rule": ((0.25,), ASSUMED + "a quarter of a pixel shows"),
    "infrared.segmentation": (("matched",), OURS + "the threshold of two known Gaussians"),
    "infrared.inner_radius": ((0.5,), FITTED + "to Table 5, 25 km; the source states no radius"),
    "infrared.interpolation": (("nearest",), OURS + "11 to 18 categories, as of Table 5"),
    "infrared.training_range": ((RANGES[0],), "source, Table 5"),
    "infrared.subpixel_offsets": (tuple(range(4)), OURS + "means over four places on the detector"),
    "infrared.orders": (tuple(range(4)), OURS + "means over four orders of presentation"),
    "classifier.template_spacing": ((None,), "source: all aspects are learned"),
    "classifier.learning_rate": (
        (0.1,),
        ASSUMED + "the source prints none; 0.3 and 1 form more categories than its Table 3",
    ),
    "classifier.learn_in_test": ((False,), OURS + "the source learns in its tests, too"),
    "classifier.left_out": ((False,), "source: the aspects tested are learned"),
    "classifier.label_rule": (("majority",), OURS + "the source names no rule"),
    "classifier.score_rule": (("ship",), OURS + "the question is which ship it is"),
    "classifier.mnn.tolerance": ((0.35,), FITTED + "to Table 2, root mean square 6.2 points"),
    "classifier.mnn.learning_rate": (
        (0.015,),
        OURS + "the source prints none; the tolerance decides, not this",
    ),
    "classifier.mnn.epochs": ((1000,), OURS + "never reached at this tolerance"),
    "classifier.mnn.grow_every": ((10,), OURS + "the source states no schedule"),
    "classifier.mnn.max_hidden": ((25,), OURS + "the source states no number"),
    "classifier.mnn.inputs": (("standardised",), OURS + "raw profiles do not train at this G"),
    "classifier.mnn.annealing": ((True,), "source: gains are annealed"),
    "classifier.floor_sigma": ((1,), OURS + "a floor not known, as of a normalised profile"),
    "classifier.floor_estimated": ((False,), OURS + "the floor is integrated out instead"),
    "classifier.template_error": ((None,), "calibrated on aspects left out"),
    "classifier.aspect_known": ((False,), "source: no track gives the heading"),
    "classifier.orders": ((0,), OURS + "the grid's own order"),
    "ladar.subpixel_offsets": ((0,), OURS + "the ship's origin on a corner of IFOVs"),
    "classifier.gain_sigma": ((1,), OURS + "a gain not known, as of a normalised profile"),
    "classifier.diagonal_loading": ((1e-3,), OURS + "30 dB below a bin's own noise"),
    "irar.range": ((3.9,), "source, Figure 15, the Roberts"),
    "irar.depression": ((6.7,), "source, Figure 16"),
    "irar.mirror_angle": ((45,), "source, 'Data Processing'"),
    "irar.range_sigma": ((1,), "source: 1 m precision"),
    "irar.detectors": ((12,), "source: a line of 12"),
    "irar.ifov": ((205,), "source, Figure 16: 0.8 m at 3.9 km"),
    "irar.line_rate": ((119,), ASSUMED + "8 to 12 lines a pixel at 3 to 5 km"),
    "irar.aircraft_speed": ((90,), ASSUMED + "the source gives none"),
    "irar.ship_speed": ((8,), ASSUMED + "the source gives none"),
    "irar.cnr": ((20,), ASSUMED + "the source gives none"),
    "irar.pulse_rate": ((20_000,), ASSUMED + "the source gives none"),
    "seed": ((0,), "every figure that is not a mean over draws is of this one"),
}
OF_NO_FIGURE = (  # of Ladar, Infrared and Classifier: where to run, what to look at, what is null
    *("infrared.range", "infrared.frame_count", "infrared.vigilance", "infrared.super_resolution"),
    *("infrared.window_length", "infrared.window_height"),
    *("classifier.name", "classifier.unknown", "classifier.training_aspect"),
    *("classifier.test_vigilance", "classifier.training", "classifier.max_passes"),
)


def values_of(choices, key):
    (setting,) = (one for one in EXPERIMENT.declared if one.key == key)
    return choices.values[setting.key]


@pytest.fixture(scope="module")
def defaults():
    """What a command without a word on its line asks for."""
    return chosen()


@pytest.mark.parametrize("key", PUBLISHED)
def test_a_setting_is_what_published_figures_were_made_with(defaults, key):
    value, reason = PUBLISHED[key]
    found = values_of(defaults, key)
    found = found if isinstance(found, tuple) else (found,)
    assert tuple(found) == value, f"{key}: {reason}"


def test_every_setting_of_the_sensors_and_classifiers_says_where_it_comes_from():
    groups = ("grid.", "scene.", "ladar.", "infrared.", "classifier.")
    keys = {one.key for one in EXPERIMENT.declared if one.key.startswith(groups)}
    assert keys - {"grid.zip"} - set(OF_NO_FIGURE) <= set(PUBLISHED)


def test_the_source_s_own_experiments_are_asked_for():
    paper = chosen("+experiment=paper")
    assert values_of(paper, "grid.pulse_width") == tuple(SOURCE["table3_categories"]["categories"])
    assert SOURCE["table3_categories"]["vigilance"] in values_of(paper, "grid.vigilance")
    assert values_of(paper, "infrared.vigilance") == (SILHOUETTES["vigilance"],)
    assert values_of(paper, "infrared.frame_count") == (SILHOUETTES["frame_count"],)
    assert values_of(paper, "infrared.range") == RANGES
    views = len(values_of(paper, "grid.ship")) * len(values_of(paper, "grid.aspect"))
    assert views == SOURCE["experiment"]["views"]
    assert values_of(chosen("+experiment=table5"), "grid.vigilance") == (SILHOUETTES["vigilance"],)


def test_what_the_source_does_not_print_follows_from_what_it_does():
    """To half the last digit printed."""
    flat = depression_angle(100e3, altitude=ALTITUDE, earth_radius=1e12)
    assert round(flat, 2) == PUBLISHED["scene.depression"][0][0]
    far = SOURCE["table1_sensor"]["ranges"][100]
    ratios = float(far["contrast_k"]) * np.sqrt(16 / (float(far["snr"]) + np.array([0.05, -0.05])))
    low, high = ratios * (1 + np.array([-1, 1]) * 0.005 / float(far["contrast_k"]))
    assert low <= infrared.NEDT <= high
    middle = SOURCE["table1_sensor"]["ranges"][50]
    behind = infrared.NEDT / 4 * math.sqrt(float(middle["snr"]))
    before = behind * 10 ** (float(middle["attenuation_db"]) / 20)
    assert pytest.approx(before, rel=0.05 / 58 / 2 + 1e-3) == infrared.CONTRAST_AT_ZERO
    for distance, row in SOURCE["table1_sensor"]["ranges"].items():
        loss = infrared.EXTINCTION * distance * 1e3
        assert loss == pytest.approx(float(row["attenuation_db"]), abs=0.05)


def test_the_library_s_own_defaults_are_the_same():
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
