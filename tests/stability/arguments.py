"""Functions by name, good arguments of each, and wrong values of some."""

import importlib
import math
from dataclasses import fields

import numpy as np
from hard_meshes import box

from ncti.irar import Flight
from ncti.render import range_image

NAN, INF = math.nan, math.inf
RNG = np.random.default_rng(0)
BOX = box()
IMAGE = range_image(BOX, aspect=37.0, depression=3.84, pixel=0.5, engine="embree")
EXTENT = importlib.import_module("ncti.ladar").range_extent(IMAGE, slant_range=1e5)
NO_NUMBER = {"words": "far", "None": None, "ragged": [[4.0, 16.0], 4.0], "complex": 1j}
SIGNAL = {"extent": EXTENT, "pulse_width": 30e-9, "cnr": 1e3, "target_free_ifovs": 0}
OF_SIGNAL = {
    "pulse_width": [NAN, INF, -1.0, 0.0, 1e-16, 2.0],
    "cnr": [NAN, INF, -1.0, 1e21],
    "target_free_ifovs": [NAN, INF, -1, 1.5],
}
VIEW = {"mesh": BOX, "aspect": 37.0, "depression": 3.84}
OF_VIEW = {
    "aspect": [NAN, INF, math.nextafter(360.0, 361.0), -361.0],
    "depression": [NAN, INF, math.nextafter(90.0, 91.0), -5e-324],
    "slant_range": [NAN, INF, -INF, 0.0, 40.0],
}
HEADINGS = ("aircraft_heading", "ship_heading", "aircraft_track", "offset", "pointing")
FROM_ZERO = ("ship_speed", "range_sigma", "threshold", "nedt", "contrast_at_zero", "clutter")
FROM_ZERO += ("band_extinction", "jitter")
OF_FLIGHT = {
    one.name: [361, -361, NAN]
    if one.name in HEADINGS
    else [-1 if one.name in FROM_ZERO else 0, 1e30, NAN]
    for one in fields(Flight)
}
OF_PHASE = [(1.5, 0.0), (0.0, 1.0), (NAN, 0.0)]
SHIFT = {
    **{"aircraft_speed": 90.0, "aircraft_heading": 0.0, "ship_speed": 8.0, "ship_heading": 0.0},
    **{"offset": 5.0, "slant_range": 3900.0, "ifov": 205e-6, "rate": 119.0},
}
PIECES = {"training": np.eye(3), "tests": np.eye(3)}
SIMULATED = {"ship": BOX, "aspect": 30.0, "rng": 0}
OF_SIMULATION = {
    "ship": [[5], None, "bismarck"],
    "aspect": [400.0, INF, [], [[1.0]], "bow"],
    "slant_range": [-1.0, 0.0, 25, NAN],
    "ifov": [0.0, 1e-9],
    "frames": [0, 1.5],
    "rng": [-1, "today", True, 1.0],
}

CASES = {
    "infrared.attenuation": ({"slant_range": 1e3}, {"slant_range": [-1.0, NAN, INF]}),
    "infrared.contrast": (
        {"slant_range": 1e3},
        {
            "slant_range": [[1.0, NAN], *NO_NUMBER.values()],
            "extinction": [-1e-9],
            "contrast_at_zero": [INF],
        },
    ),
    "infrared.noise_temperature": (
        {"frame_count": 4},
        {
            "frame_count": [0, [4, -1], 2.5, ["16"], 10**400, *NO_NUMBER.values()],
            "nedt": [-0.1],
        },
    ),
    "infrared.snr": ({"slant_range": 0.0}, {"nedt": [0.0], "contrast_at_zero": [1e200]}),
    "infrared.band_contrast": (
        {"slant_range": 1e3},
        {
            "slant_range": [-1.0],
            "band": [(12e-6, 8e-6), (0.0, 8e-6)],
            "sea_temperature": [0.0],
            "extinction": [-1.0],
            "contrast_at_zero": [NAN, -400.0],
        },
    ),
    "infrared.detection_probability": (
        {"target": 3, "contrast": 0.3, "target_sigma": 0.2, "sea_sigma": 0.15, "false_alarm": 0.01},
        {
            "false_alarm": [0.0, 1.0, NAN],
            "sea_sigma": [0.0],
            "target_sigma": [0.0, -1.0],
            "contrast": [INF],
            "target": [-1, 1.5, None, "5", 10**400, [[True], [True, False]], np.array([5, 7])],
        },
    ),
    "infrared.pixel_sigma": (
        {"spread": 0.1, "frame_count": 4},
        {"spread": [-0.1], "frame_count": [0], "nedt": [NAN], "super_resolution": ["magic"]},
    ),
    "infrared.image": (
        {"image": IMAGE, "slant_range": 50e3, "frame_count": 16, "rng": RNG},
        {
            "slant_range": [0.0, NAN, "far", 1, 1e300],
            "ifov": [-1e-6, 1e300],
            "coverage_rule": [0.0, 2],
            "super_resolution": ["magic"],
            "frame_count": [0, "16", None, 10**300, (4, 1.5), [[4, 16]], [[4, 16], 1], ()],
            "rng": [None, 3],
            "margin": [0.5],
            "contrast_at_zero": [NAN],
            "extinction": [-1.0],
            "nedt": [-0.1],
            "target_spread": [-0.1, "2"],
            "sea_spread": [INF],
            "phase": [*OF_PHASE, 0.5, (0.1, 0.2, 0.3), ((0.1, 0.2), 0.3)],
            "extent": [(-1.0, 1.0, -1.0, 1.0), (-99.0, 99.0, -99.0), 99.0, (None, 9.0, -9.0, 9.0)],
        },
    ),
    "infrared.silhouette": (
        {"image": IMAGE, "footprint": 3.75},
        {
            "footprint": [0.2, NAN],
            "phase": OF_PHASE,
            "margin": [-1, 1.5, 10**6],
            "subdivision": [10**6],
            "extent": [(-5.0, 5.0, -50.0, 50.0), (50.0, -50.0, -50.0, 50.0), (-INF, 50, -50, 50)],
        },
    ),
    "infrared.super_resolution.shift_and_add": (
        {"samples": np.ones((2, 2))},
        {"samples": [np.zeros((1, 9)), np.zeros(9), np.ones((2, 0))]},
    ),
    "infrared.reconstruction_error": (
        {"image": np.ones((2, 2)), "fine_target": np.ones((2, 2)), "contrast": 1.0},
        {"contrast": [0.0, 1e-300], "image": [np.zeros((2, 3))]},
    ),
    "ladar.range_extent": (
        {"image": IMAGE, "slant_range": 1e5},
        {
            "slant_range": [-1.0, NAN, 1e300],
            "ifov": [0.0, 1e-9, 1.5],
            "bin_width": [NAN, INF, 1e-5],
            "window": [40.0, INF],
            "spread": [-0.1],
            "reflectance": ["shiny"],
            "shift": [(0.5,), (0.0, NAN)],
        },
    ),
    "ladar.expected_profile": (SIGNAL, OF_SIGNAL | {"receiver": ["ear"]}),
    "ladar.frame_moments": (SIGNAL, OF_SIGNAL | {"frame_count": [0]}),
    "ladar.banded_frame_moments": (SIGNAL, OF_SIGNAL | {"frame_count": [0]}),
    "ladar.sample_frames": (
        SIGNAL | {"frame_count": 1, "rng": RNG},
        OF_SIGNAL | {"frame_count": [0, 1.5, NAN], "rng": [None], "receiver": ["ear"]},
    ),
    "ladar.cumulative_average": (
        {"frames": np.ones((3, 5)), "frame_counts": [1, 3]},
        {"frame_counts": [[]]},
    ),
    "ladar.carrier_to_noise": ({"slant_range": 1e5}, {"slant_range": [0.0, NAN, 1e10]}),
    "render.far_field_error": (
        {"reach": 70.0, "slant_range": 1e5},
        {"reach": [-1.0], "slant_range": [0.0, NAN], "across": [-1.0]},
    ),
    "render.range_image": (
        VIEW,
        OF_VIEW | {"roll": [INF], "pixel": [0.0, -0.25, NAN], "engine": ["vulkan"]},
    ),
    "render.mask.ship_mask": (VIEW | {"pixel": 0.5}, OF_VIEW | {"pixel": [0.0, NAN]}),
    "render.line_image": (VIEW, OF_VIEW | {"spacing": [0.0, 1e-9, NAN], "phase": [1e10]}),
    "render.cast_rays": (
        {"mesh": BOX, "origin": np.ones((4, 3)), "direction": np.ones((4, 3))},
        {"origin": [np.ones((5, 3)), np.ones(3), np.ones((4, 2))]},
    ),
    "search.Field": (
        {"width": 0.3, "height": 0.1, "ifov": 150e-6},
        {"width": [0.0], "ifov": [1e-7]},
    ),
    "search.detect": (
        {"image": np.zeros((2, 2)), "threshold": 1.0, "reach": (1, 1)},
        {"threshold": [NAN], "reach": [(1, -1)]},
    ),
    "search.position_count": (
        {"width": 1.0, "height": 1.0, "element": 1.0},
        {"width": [0.0], "detector": [0]},
    ),
    "search.most_pulses": ({"slant_range": 1e5}, {"slant_range": [-1.0]}),
    "features.log_polar": (
        {"mask": np.eye(4)},
        {
            "mask": [np.ones(4), np.ones((0, 4)), np.full((4, 4), 1.5)],
            "inner_radius": [0.0],
            "outer_radius": [0.5],
            "radii": [0],
            "angles": [2.5],
            "oversample": [0],
            "interpolation": ["cubic"],
        },
    ),
    "features.cyclic_similarity": (
        {"a": np.ones((4, 2)), "b": np.ones((4, 2))},
        {"a": [np.ones(4)], "b": [np.ones((4, 3))]},
    ),
    "features.profile_vector": (
        {"profile": np.arange(9.0), "floor": 0.0},
        {"profile": [[1e301], np.ones((3, 0))], "floor": [1e301]},
    ),
    "features.segment": (
        {"image": np.zeros((4, 4)), "contrast": 1.28, "target_sigma": 0.1, "sea_sigma": 0.1},
        {
            "image": [np.zeros(4), np.zeros((0, 4))],
            "method": ["magic"],
            "contrast": [None, -1.0],
            "target_sigma": [None, 0.0],
            "sea_sigma": [None, NAN],
        },
    ),
    "classify.cluster": (
        {
            "similarities": importlib.import_module("ncti.classify").Similarities.of(**PIECES),
            "vigilance": 0.9,
            "order": np.arange(3),
        },
        {
            "vigilance": [1.5, NAN],
            "learning_rate": [0.0],
            "max_passes": [2.5],
            "order": [np.zeros(0, int), [0, 3], [0, -1], [0.7, 1], [2, 0, 2], [[0, 1]]],
        },
    ),
    "classify.Similarities.of": (
        PIECES,
        {
            "training": [np.ones(3), np.ones((0, 3))],
            "tests": [np.ones((1, 2)), np.ones(3)],
        },
    ),
    "classify.label_posterior": (
        {"scores": np.zeros((2, 4)), "labels": list("abcd")},
        {
            "scores": [np.zeros((2, 3))],
            "exclude": [[True, False], [True] * 4],
        },
    ),
    "classify.calibration.fit_temperature_and_outliers": (
        {"scores": np.eye(2), "labels": [0, 1], "truth": [0, 1]},
        {"scores": [np.zeros(2)], "truth": [[0], [0, 0, 0], [[0, 0]], [0, 7]]},
    ),
    "evaluate.wilson_interval": (
        {"successes": 1, "trials": 3},
        {"successes": [-1, 4]},
    ),
    "evaluate.aspect_bins": (
        {"aspects": [3.0]},
        {"aspects": [[], [[0.0]], [-1.0], [361.0]]},
    ),
    "evaluate.open_set_scores": (
        {"similarity": [0.5, 0.6], "correct": [True, False], "known": [True, False]},
        {
            "correct": [[1.0, 0.0]],
            "known": [[True, False, True]],
        },
    ),
    "evaluate.rejection_thresholds": (
        {"similarity": [0.5, 0.6], "shares": [0.0, 1.0]},
        {"shares": [[-0.1], [1.1]]},
    ),
    "evaluate.replicated_accuracy": (
        {"correct": np.zeros((2, 4, 3), bool), "aspects": [0.0, 3.0, 6.0]},
        {"correct": [np.zeros((2, 4, 3)), np.zeros((4, 3), bool)], "draws": [-1, 2]},
    ),
    "evaluate.category_formation": (
        {"labels": [0, 1], "ships": ["duncan", "texas"], "aspects": [0.0, 0.0]},
        {"labels": [[0], [0.5, 1.0]], "ships": [["duncan", "duncan"]]},
    ),
    "irar.Correction": ({}, {"azimuth": ["row"], "mirror": ["x"], "range_filter": ["mode"]}),
    "irar.Flight": (
        {"slant_range": 3900.0, "ship_heading": 0.0},
        OF_FLIGHT
        | {
            "slant_range": [99, *NO_NUMBER.values()],
            "aircraft_speed": [0, 5.0],
            "ship_heading": [361, -361, "1"],
            "samples": [1, 160.5],
            "pulse_rate": [0, 19_000],
            "range_gate": [9],
            "detectors": [0, 1.5],
            "band_start": [0, 12e-6],
            "sea_temperature": [99],
        },
    ),
    "irar.azimuth_shift": (
        SHIFT,
        {
            "aircraft_speed": [-1],
            "ship_speed": [-0.1],
            "slant_range": [0],
            "ifov": [0],
            "rate": [0, NAN],
            "scans": [0],
            "offset": [NAN],
            "aircraft_heading": [INF],
            "ship_heading": ["north"],
        },
    ),
    "irar.mirror_rotation": (
        {"depression": 6.7},
        {"depression": [-1, 90, NAN], "mirror_angle": [0, 90], "form": ["plain"]},
    ),
    "irar.clusters.histogram_cluster_average": (
        {"ranges": [1.0, 2.0], "window": 4.0},
        {"window": [0.0, NAN], "ranges": [[1.0, INF]]},
    ),
    "irar.clutter.clutter": (
        {"places": np.zeros((1, 2)), "deviation": 1.0, "length": 1.0, "rng": RNG},
        {"deviation": [-1.0], "length": [0.0], "rng": [3]},
    ),
    "irar.looks.gather_looks": (
        {"row": [0.0, 1.0], "column": [0.0, 1.0], "rows": [0, 1], "columns": 2},
        {"column": [[0.0]], "rows": [[1, 0], [0, NAN]], "columns": [0, 2.5]},
    ),
    "irar.profiling.range_profile": (
        {"intensity": [1.0, 2.0], "down_range": [0.5, 1.5], "start": 0.0, "bins": 4},
        {
            "down_range": [[1.0]],
            "intensity": [[1.0, NAN]],
            "start": [NAN],
            "bins": [0],
            "bin_width": [0.0],
        },
    ),
    "irar.segmentation.noise_threshold": (
        {"looks": 10, "depth": 300.0, "pulse_length": 4.5, "dropout": 4.0, "false_alarm": 0.01},
        {
            "depth": [-1.0],
            "pulse_length": [0.0],
            "dropout": [NAN],
            "looks": [0, 2.5],
            "false_alarm": [0.0, 0.7],
        },
    ),
    "irar.segmentation.segment": (
        {"intensity": [7.0, 8.0], "range_": [1.0, 2.0], "threshold": 5.0},
        {"range_": [[1.0]], "threshold": [[5.0, 5.0, 5.0], -1.0, NAN]},
    ),
    "irar.landmarks": (
        {"profile": np.eye(9)[4], "down_range": np.arange(9.0)},
        {
            "profile": [np.ones((2, 2)), np.full(9, NAN)],
            "down_range": [np.arange(8.0), -np.arange(9.0), np.arange(9.0) ** 3],
            "hangar": [(100.0, 120.0)],
            "mast": [(50.0, 40.0)],
            "end": [0.0],
        },
    ),
    "irar.profile_correlation": (
        {"first": np.arange(5.0), "second": np.arange(5.0)},
        {"first": [[NAN] * 5], "second": [np.zeros(4)], "exclude": [[1, 2], [True] * 4 + [False]]},
    ),
    "irar.tilts": (
        {"image": np.eye(8), "truth": np.eye(8)},
        {"truth": [np.ones((12, 8)), np.zeros((8, 8))]},
    ),
    "irar.time_delay_integrate": (
        {"samples": np.ones((2, 3, 9))},
        {"samples": [np.zeros((4, 8)), np.zeros((0, 4, 8))]},
    ),
    "simulate.range_profile": (
        SIMULATED | {"target_free_ifovs": 50},
        OF_SIMULATION
        | {
            "pulse_width": [5e-9, NAN, 1e-3],
            "accuracy": [0.0],
            "depression": [91.0],
            "bin_width": [0.0, 1e-9],
            "window": [20.0],
            "cnr_db": [1584.9],
            "target_free_ifovs": [-1],
        },
    ),
    "simulate.infrared_image": (
        SIMULATED,
        OF_SIMULATION
        | {"foo": [3], "super_resolution": ["deep"], "phase": [(0.0, 1.0)], "nedt": [-1.0]},
    ),
    "simulate.flight": (
        None,
        {
            "ship": [None],
            "aspect": [400.0],
            "slant_range": [1.0],
            "ship_heading": [[3.0]],
            "speed": [[3.0]],
            "cnr": [[100.0]],
            "cnr_db": [100.0],
            "aircraft_heading": ["north"],
            "correction": ["x"],
            "rng": [None],
        },
    ),
}


def found(path):
    """What a dotted name below `ncti` is."""
    *modules, name = path.split(".")
    thing = importlib.import_module("ncti")
    for part in (*modules, name):
        if not hasattr(thing, part):
            importlib.import_module(f"{thing.__name__}.{part}")
        thing = getattr(thing, part)
    return thing
