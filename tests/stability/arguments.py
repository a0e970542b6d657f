"""Tables of functions, valid arguments of each, and invalid values by argument name."""

import importlib
import inspect
import math

import numpy as np
from hard_meshes import box, mesh

import ncti
from ncti import classify
from ncti.irar import Flight
from ncti.ladar import range_extent
from ncti.render import range_image

NAN, INF = math.nan, math.inf
RNG = np.random.default_rng(0)
BOX = box()
IMAGE = range_image(BOX, aspect=37.0, depression=3.84, pixel=0.5, engine="embree")
EXTENT = range_extent(IMAGE, slant_range=1e5)
PIECES = {"training": np.eye(3), "tests": np.eye(3)}
SIMILARITIES = classify.Similarities.of(**PIECES)
SIGNAL = {"extent": EXTENT, "pulse_width": 30e-9, "cnr": 1e3, "target_free_ifovs": 0}
VIEW = {"mesh": BOX, "aspect": 37.0, "depression": 3.84}
FLIGHT = {"slant_range": 3900.0, "ship_heading": 0.0}
FACET = [[0, 1, 2]]
LINE = mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], FACET)
ROWS = np.eye(4), ["duncan"] * 4, [0, 0, 1, 1]  # vectors, classes and views
SIMULATED = {"ship": BOX, "aspect": 30.0, "rng": 0}

# Each function below `ncti`, with arguments that it takes.
GOOD = {
    "infrared.attenuation": {"slant_range": 1e3},
    "infrared.contrast": {"slant_range": 1e3},
    "infrared.noise_temperature": {"frame_count": 4},
    "infrared.snr": {"slant_range": 0.0},
    "infrared.band_contrast": {"slant_range": 1e3},
    "infrared.detection_probability": {
        **{"pixels": 3, "contrast": 0.3, "target_sigma": 0.2, "sea_sigma": 0.15},
        "false_alarm": 0.01,
    },
    "infrared.pixel_sigma": {"spread": 0.1, "frame_count": 4},
    "infrared.Imager": {},
    "infrared.image": {"image": IMAGE, "slant_range": 50e3, "frame_count": 16, "rng": RNG},
    "infrared.silhouette": {"image": IMAGE, "footprint": 3.75},
    "infrared.reconstruction_error": {
        **{"image": np.ones((2, 2)), "fine_target": np.ones((2, 2)), "contrast": 1.0},
    },
    "ladar.range_extent": {"image": IMAGE, "slant_range": 1e5},
    "ladar.expected_profile": SIGNAL,
    "ladar.frame_moments": SIGNAL,
    "ladar.banded_frame_moments": SIGNAL,
    "ladar.sample_frames": SIGNAL | {"frame_count": 1, "rng": RNG},
    "ladar.cumulative_average": {"frames": np.ones((3, 5)), "frame_counts": [1, 3]},
    "ladar.carrier_to_noise": {"slant_range": 1e5},
    "render.far_field_error": {"reach": 70.0, "slant_range": 1e5},
    "render.range_image": VIEW | {"engine": "embree"},
    "render.line_image": VIEW,
    "render.cast_rays": {"mesh": BOX, "origin": np.ones((4, 3)), "direction": np.ones((4, 3))},
    "features.log_polar": {"mask": np.eye(4)},
    "features.cyclic_similarity": {"a": np.ones((4, 2)), "b": np.ones((4, 2))},
    "features.profile_vector": {"profile": np.arange(9.0), "floor": 0.0},
    "features.segment": {
        **{"image": np.zeros((4, 4)), "contrast": 1.28, "target_sigma": 0.1, "sea_sigma": 0.1},
    },
    "classify.cluster": {"similarities": SIMILARITIES, "vigilance": 0.9, "order": np.arange(3)},
    "classify.Similarities.of": PIECES,
    "classify.label_posterior": {"scores": np.zeros((2, 4)), "labels": list("abcd")},
    "evaluate.wilson_interval": {"successes": 1, "trials": 3},
    "evaluate.aspect_bins": {"aspects": [3.0]},
    "evaluate.accuracy_by_aspect": {"correct": np.zeros((4, 3), bool), "aspects": [0.0, 3.0, 6.0]},
    "evaluate.open_set_scores": {
        **{"similarity": [0.5, 0.6], "correct": [True, False], "known": [True, False]},
    },
    "evaluate.rejection_thresholds": {"similarity": [0.5, 0.6], "shares": [0.0, 1.0]},
    "evaluate.replicated_accuracy": {
        **{"correct": np.zeros((2, 4, 3), bool), "aspects": [0.0, 3.0, 6.0]},
    },
    "evaluate.category_formation": {
        **{"labels": [0, 1], "ships": ["duncan", "texas"], "aspects": [0.0, 0.0]},
    },
    "evaluate.score": {
        **{"y": ["duncan", "texas"], "predicted": ["duncan", "duncan"], "aspect": [0.0, 30.0]},
        **{"groups": [0, 1], "classes": ["duncan", "texas"], "similarity": [0.5, 0.6]},
    },
    "evaluate.compare": {
        **{"first": [True] * 5, "second": [False] * 5, "groups": np.arange(5), "rng": RNG},
    },
    "evaluate.learning_curve": {
        "classifier": classify.CorrelationNeighbour(),
        **{"train": ROWS, "test": ROWS, "views": [1], "draws": [1, 2], "rng": RNG},
    },
    "evaluate.grouped_accuracy": {
        **{"correct": [True, False], "aspects": [0.0, 3.0], "groups": [0, 1]},
    },
    "irar.Correction": {},
    "irar.Flight": FLIGHT,
    "irar.azimuth_shift": {"flight": Flight(**FLIGHT), "slant_range": 3900.0, "rate": 119.0},
    "irar.mirror_rotation": {"depression": 6.7},
    "irar.landmarks": {"profile": np.eye(9)[4], "down_range": np.arange(9.0)},
    "irar.profile_correlation": {"first": np.arange(5.0), "second": np.arange(5.0)},
    "irar.tilts": {"image": np.eye(8), "truth": np.eye(32)},
    "irar.time_delay_integrate": {"samples": np.ones((2, 3, 9))},
    "data.dataset": {"ships": ["duncan"], "count": 1, "seed": 0, "frames": 1},
    "data.split": {
        "name": "few-frames",
        "seed": 0,
        "ships": ["duncan", "texas"],
        "train": 1,
        "test": 1,
    },
    "data.to_numpy": {
        "rows": ncti.dataset(["duncan"], 1, seed=0, frames=1),
    },
    "simulate.range_profile": SIMULATED | {"target_free_ifovs": 50},
    "simulate.infrared_image": SIMULATED,
    "simulate.flight": SIMULATED,
}


def broken(value):
    """Return the box with a coordinate that is not a number."""
    vertices = np.array(BOX.vertices)
    vertices[3, 1] = value
    return mesh(vertices, BOX.faces)


NO_NUMBER = ["far", 1j, [[4.0, 16.0], 4.0]]
# Values that every function with an argument of the name refuses, by kind and by name.
KINDS = [
    ("detectors max_passes oversample radii", [0, 1.5, NAN, INF]),
    ("angles", [0, 2.5, NAN]),
    (
        "accuracy bin_width clutter_length footprint ifov inner_radius jitter_time learning_rate "
        "line_rate pixel rate sea_temperature spacing window",
        [0.0, -1.0, NAN, INF, *NO_NUMBER],
    ),
    (
        "across band_extinction clutter extinction jitter nedt "
        "range_sigma sea_spread ship_speed spread target_spread",
        [-0.1, NAN, INF, *NO_NUMBER],
    ),
    (
        "azimuth correction engine form interpolation method mirror range_filter receiver "
        "reflectance super_resolution",
        ["magic"],
    ),
    ("contrast contrast_at_zero roll", [NAN, INF]),
    ("aircraft_heading offset ship_heading", [NAN, INF, "north", [3.0]]),
    ("aircraft_track pointing", [361, -361, NAN]),
    ("sea_sigma target_sigma", [0.0, -1.0, None, NAN]),
    ("band_start band_stop", [0, 1e30, NAN]),
]
WRONG = {name: values for names, values in KINDS for name in names.split()} | {
    "a": [np.ones(4)],
    "aircraft_speed": [-1, NAN],
    "aspect": [NAN, INF, math.nextafter(360.0, 361.0), -361.0, [], [[1.0]], "bow"],
    "aspects": [[], [[0.0]], [-1.0], [361.0]],
    "b": [np.ones((4, 3))],
    "band": [(12e-6, 8e-6), (0.0, 8e-6)],
    "cnr": [NAN, INF, 1e21],
    "cnr_db": [1584.9],
    "coverage_rule": [0.0, 2],
    "depression": [NAN, INF, math.nextafter(90.0, 91.0), -5e-324],
    "down_range": [[1.0]],
    "draws": [-1, 2],
    "end": [0.0],
    "exclude": [[True, False], [True] * 4],
    "first": [[NAN] * 5],
    "floor": [1e301],
    "frame_count": [0, [4, -1], 2.5, NAN, ["16"], "16", 10**400, None, 1j],
    "frame_counts": [[]],
    "hangar": [(100.0, 120.0)],
    "known": [[True, False, True]],
    "margin": [0.5, -1, 10**6],
    "mask": [np.ones(4), np.ones((0, 4)), np.full((4, 4), 1.5)],
    "mirror_angle": [0, 90, NAN],
    "mesh": [mesh(np.zeros((3, 3)), FACET), LINE, *map(broken, (NAN, INF, -INF))],
    "order": [np.zeros(0, int), [0, 3], [0, -1], [0.7, 1], [2, 0, 2], [[0, 1]]],
    "origin": [np.ones((5, 3)), np.ones(3), np.ones((4, 2))],
    "outer_radius": [0.5],
    "phase": [(1.5, 0.0), (0.0, 1.0), (NAN, 0.0), (0.1, 0.2, 0.3), ((0.1, 0.2), 0.3), 1e10],
    "profile": [[1e301], np.ones((3, 0))],
    "pulse_rate": [0, 19_000],
    "pulse_width": [NAN, INF, -1.0, 0.0, 1e-16, 2.0],
    "range_gate": [9],
    "rng": [None, -1, "today", True, 1.0],
    "rows": [[1, 0], [0, NAN]],
    "scans": [0],
    "scores": [np.zeros((2, 3)), np.zeros(2)],
    "second": [np.zeros(4)],
    "shares": [[-0.1], [1.1]],
    "shift": [(0.5,), (0.0, NAN)],
    "ship": [[5], None, "bismarck"],
    "ships": [["duncan", "duncan"]],
    "slant_range": [-1.0, NAN, INF, -INF, [1.0, NAN], *NO_NUMBER],
    "subdivision": [10**6],
    "successes": [-1, 4],
    "pixels": [-1, 1.5, None, "5", 10**400, [[True], [True, False]], np.array([5, 7])],
    "target_free_ifovs": [NAN, INF, -1, 1.5],
    "tests": [np.ones((1, 2)), np.ones(3)],
    "threshold": [NAN],
    "training": [np.ones(3), np.ones((0, 3))],
    "vigilance": [1.5, NAN],
}
TOO_LARGE = (
    "nedt clutter jitter range_sigma pulse_width band_extinction jitter_time clutter_length "
    "line_rate mirror_angle ship_speed ifov"
)
# Further values that single functions refuse.
OTHERS = {
    "infrared.contrast": {"slant_range": [None]},
    "infrared.noise_temperature": {"frame_count": NO_NUMBER},
    "infrared.snr": {"nedt": [0.0], "contrast_at_zero": [1e200]},
    "infrared.band_contrast": {"contrast_at_zero": [-400.0]},
    "infrared.detection_probability": {"false_alarm": [0.0, 1.0, NAN]},
    "infrared.image": {
        "slant_range": [0.0, 1, 1e300],
        "ifov": [1e300],
        "frame_count": [10**300, (4, 1.5), [[4, 16]], [[4, 16], 1], ()],
        "rng": [3],
        "phase": [0.5],
        "imager": [None, {"nedt": 0.1}],
    },
    "infrared.silhouette": {
        "footprint": [0.2],
        "extent": [(-5.0, 5.0, -50.0, 50.0), (50.0, -50.0, -50.0, 50.0), (-INF, 50, -50, 50)],
    },
    "infrared.reconstruction_error": {"contrast": [0.0, 1e-300], "image": [np.zeros((2, 3))]},
    **{
        f"ladar.{name}": {"cnr": [-1.0, [100.0]]}
        for name in ("expected_profile", "frame_moments", "banded_frame_moments", "sample_frames")
    },
    "data.dataset": {
        **{"count": [0, -1, 1.5, NAN, "9", 10**12], "seed": [-1, 1.5, NAN, "today", 10**400]},
        **{"first": [-1, 0.5], "workers": [0, 1.5, 10**9], "rows_per_view": [0, 2.5, NAN]},
        **{"ships": [[], "duncan", [None], ["bismarck"]], "sensor": ["sonar", None]},
        **{"aspect": [(90.0, 0.0), (0.0, 1.0, 2.0), {"low": 0.0}]},
        **{"frames": [0, 1.5, (0, 4), [4, 2.5]], "gain": [-0.1, NAN, "high"]},
        **{"slant_range": [25, 0.0], "far_field_error": [0.0, NAN, 2.0], "window": [20.0]},
        **{"pulse_width": [5e-9, 1e-3], "ifov": [1e-9], "spacing": [1e-9], "floor": [1e9]},
    },
    "data.split": {
        **{
            "name": ["aspect", None],
            "seed": [-1, 0.5],
            "ships": [["duncan", "roberts"], ["duncan"], [], "duncan"],
        },
        **{"train": [0, 1.5], "test": [0, NAN], "workers": [0]},
    },
    "data.to_numpy": {"rows": [3, None, "rows.zarr", np.eye(3)]},
    "ladar.range_extent": {
        **{"slant_range": [1e300], "ifov": [1e-9, 1.5], "bin_width": [1e-5], "window": [40.0]},
    },
    "ladar.carrier_to_noise": {"slant_range": [0.0, 1e10]},
    "render.far_field_error": {"reach": [-1.0], "slant_range": [0.0]},
    "render.range_image": {"slant_range": [0.0, 40.0]},
    "render.line_image": {"slant_range": [0.0, 40.0], "spacing": [1e-9]},
    "features.segment": {
        **{"image": [np.zeros(4), np.zeros((0, 4))], "contrast": [None, -1.0]},
    },
    "evaluate.open_set_scores": {"correct": [[1.0, 0.0]]},
    "evaluate.wilson_interval": {"confidence": [0.0, 1.0, 95.0, NAN]},
    "evaluate.accuracy_by_aspect": {
        "correct": [np.ones((4, 3)), np.ones((4, 2), bool), np.ones(3, bool)],
    },
    "evaluate.score": {
        **{"y": [[], [NAN, 1.0], ["roberts", "roberts"], [["duncan", "texas"]]]},
        **{"predicted": [["duncan"], ["duncan", "roberts"], np.ones((2, 3)), [[NAN, 1.0]] * 2]},
        **{"groups": [[0], [NAN, 1.0]], "classes": [["texas"], [None]]},
    },
    "evaluate.compare": {
        **{"first": [[], [0.5] * 5], "second": [[True] * 4], "groups": [[0]]},
        **{"confidence": [0.0, 1.0, NAN], "resamples": [99, 0.5]},
    },
    "evaluate.learning_curve": {
        **{"train": [3, (ROWS[0], ["duncan"], ROWS[2])], "test": [ROWS[:2], (ROWS[0], [], [])]},
        **{"views": [[0], [3], [0.5], 1], "draws": [[3], [NAN]]},
    },
    "evaluate.grouped_accuracy": {"correct": [[0.5, 1.0]], "groups": [[0], [NAN, 1.0]]},
    "evaluate.replicated_accuracy": {"correct": [np.zeros((2, 4, 3)), np.zeros((4, 3), bool)]},
    "evaluate.category_formation": {"labels": [[0], [0.5, 1.0]]},
    "irar.Flight": {name: [1e30] for name in TOO_LARGE.split()}
    | {
        **{"slant_range": [99, 0, 1e30, None], "aircraft_speed": [0, 5.0, 1e30]},
        **{"samples": [1, 160.5], "depression": [0], "cnr": [0, -1.0, [100.0]]},
        **{"aircraft_heading": [361, -361], "ship_heading": [361, -361], "offset": [361, -361]},
        **{"contrast_at_zero": [-1, 1e30], "threshold": [-1, 1e30]},
        **{"band_start": [12e-6], "sea_temperature": [99]},
    },
    "irar.azimuth_shift": {"slant_range": [0]},
    "irar.mirror_rotation": {"depression": [90]},
    "irar.landmarks": {
        "profile": [np.ones((2, 2)), np.full(9, NAN)],
        "down_range": [np.arange(8.0), -np.arange(9.0), np.arange(9.0) ** 3],
    },
    "irar.profile_correlation": {"exclude": [[1, 2], [True] * 4 + [False]]},
    "irar.tilts": {"truth": [np.ones((48, 32)), np.ones((16, 16)), np.zeros((32, 32))]},
    "irar.time_delay_integrate": {"samples": [np.zeros((4, 8)), np.zeros((0, 4, 8))]},
    "simulate.range_profile": {
        **{"slant_range": [0.0, 25], "ifov": [1e-9], "frames": [0, 1.5], "bin_width": [1e-9]},
        **{"pulse_width": [5e-9, 1e-3], "window": [20.0]},
    },
    "simulate.infrared_image": {
        **{"slant_range": [0.0, 25], "ifov": [1e-9], "frames": [0, 1.5], "foo": [3]},
        **{"super_resolution": ["deep"], "phase": [(0.0, 1.0)], "nedt": [-1.0]},
    },
    "simulate.flight": {
        **{"slant_range": [1.0], "cnr_db": [100.0], "cnr": [[100.0]], "speed": [[3.0]]},
        **{"aircraft_heading": ["north"], "ship_heading": [[3.0]], "correction": ["x"]},
    },
}


def found(path):
    """Return the object of a dotted name below `ncti`."""
    thing = ncti
    for part in path.split("."):
        if not hasattr(thing, part):
            importlib.import_module(f"{thing.__name__}.{part}")
        thing = getattr(thing, part)
    return thing


def refused(path):
    """Yield names of a function's arguments, each with a value that it refuses."""
    taken = [name for name in inspect.signature(found(path)).parameters if name in WRONG]
    for wrong in ({name: WRONG[name] for name in taken}, OTHERS.get(path, {})):
        for name, values in wrong.items():
            yield from ((name, value) for value in values)
