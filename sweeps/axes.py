"""The axes of a store: their names, what they mean, and which of them go together."""

from __future__ import annotations

AXES: dict[str, dict[str, str]] = {
    "ship": {"long_name": "ship"},
    "aspect": {"units": "degree", "long_name": "aspect, 0 bow-on, 90 port beam"},
    "pulse_width": {"units": "ns", "long_name": "pulse width, full width at 1/e^2"},
    "frame_count": {"units": "1", "long_name": "frames averaged"},
    "range": {"units": "km", "long_name": "slant range"},
    "learning_rate": {"units": "1", "long_name": "learning rate in training"},
    "vigilance": {"units": "1", "long_name": "vigilance in training"},
    "label_rule": {"long_name": "how a category gets its ship: most, or first of its members"},
    "score_rule": {"long_name": "what is right: the ship, or the category of the same view"},
    "target_free_ifovs": {"units": "1", "long_name": "target-free IFOVs accumulated a frame"},
    "training": {"long_name": "what is learned: expected profiles, or other draws of noisy ones"},
    "gain_sigma": {"units": "1", "long_name": "prior standard deviation of the target's gain"},
    "left_out": {"units": "1", "long_name": "1 where nothing is learned of the true aspect"},
    "epochs": {"units": "1", "long_name": "presentations of the training profiles at most"},
    "grow_every": {"units": "1", "long_name": "presentations before another hidden node"},
    "mnn_learning_rate": {"units": "1", "long_name": "learning rate of the multilayered network"},
    "tolerance": {"units": "1", "long_name": "root mean square error at which training stops"},
    "inputs": {"long_name": "what the multilayered network sees of a profile"},
    "annealing": {"units": "1", "long_name": "1 where gains are annealed"},
    "down_range": {"units": "m", "long_name": "down-range from the ship origin"},
    "super_resolution": {"long_name": "how an image gets finer than the detector"},
    "coverage_rule": {"units": "1", "long_name": "share of a pixel that a ship fills to show"},
    "segmentation": {"long_name": "how a silhouette is cut out of an image"},
    "inner_radius": {"units": "1", "long_name": "inner radius of the map, in sqrt(area / pi)"},
    "interpolation": {"long_name": "how the map samples a silhouette"},
    "phase": {"units": "1", "long_name": "number of the ship's place on the detector's pixels"},
    "order": {"units": "1", "long_name": "number of the order of presentation, 0 as in the grid"},
    "replicate": {"units": "1", "long_name": "number of the draw of the noise"},
    "angle": {"units": "degree", "long_name": "angle about the centroid, from the right upwards"},
    "row": {"units": "1", "long_name": "row of pixels, from the lowest"},
    "col": {"units": "1", "long_name": "column of pixels, from the left"},
    "channel": {"long_name": "sensor that names the ship"},
    "infrared_frame_count": {"units": "1", "long_name": "infrared frames averaged"},
    "draw": {"units": "1", "long_name": "number of the pair of a replicate and a phase"},
    "radius": {"units": "1", "long_name": "place between inner (0) and outer (1) log radius"},
    "lag": {"units": "m", "long_name": "lag of a covariance, down-range"},
}
FLIGHT_AXES: dict[str, dict[str, str]] = {
    "depression": {"units": "degree", "long_name": "depression of the line of sight"},
    "aircraft_speed": {"units": "m s-1", "long_name": "speed of the aircraft"},
    "ship_speed": {"units": "m s-1", "long_name": "speed of the ship"},
    "aircraft_heading": {"units": "degree", "long_name": "heading of the aircraft, from north"},
    "aircraft_track": {
        "units": "degree",
        "long_name": "direction of the aircraft's motion, from north; NaN: its heading",
    },
    "offset": {"units": "degree", "long_name": "azimuth of the ship from the aircraft's heading"},
    "pointing": {
        "units": "degree",
        "long_name": "azimuth of the scan's middle from the aircraft's heading; NaN: at the ship",
    },
    "mirror_angle": {"units": "degree", "long_name": "mirror pointing angle"},
    "ifov": {"units": "urad", "long_name": "instantaneous field of view, and spacing of samples"},
    "line_rate": {"units": "Hz", "long_name": "lines a second"},
    "samples": {"units": "1", "long_name": "samples of a line"},
    "pulse_rate": {"units": "Hz", "long_name": "pulse-repetition frequency"},
    "range_gate": {"units": "m", "long_name": "depth in which the receiver looks for its peak"},
    "detectors": {"units": "1", "long_name": "passive detectors along the scan"},
    "jitter": {"units": "urad", "long_name": "standard deviation of the line of sight"},
    "jitter_time": {"units": "s", "long_name": "correlation time of the line of sight"},
    "transom_gain": {
        "units": "1",
        "long_name": "input on the source's word: reflectivity of the transom over the ship's",
    },
    "mast_gain": {
        "units": "1",
        "long_name": "input on the source's word: reflectivity of masts over the ship's",
    },
    "cnr": {"units": "dB", "long_name": "carrier-to-noise ratio of an IFOV that the ship fills"},
    "flown_pulse_width": {
        "units": "ns",
        "long_name": "pulse width of the flight's radar, full width at 1/e^2",
    },
    "range_sigma": {"units": "m", "long_name": "standard deviation of a measured range"},
    "threshold": {"units": "1", "long_name": "noise powers that a peak must reach to be reported"},
    "nedt": {"units": "K", "long_name": "noise-equivalent temperature difference of one sample"},
    "error": {"units": "1", "long_name": "number of what is believed wrong of the flight, 0 none"},
    "autofocus": {"units": "1", "long_name": "1 where the closing speed is found in the image"},
    "chain": {"long_name": "whose corrections: exact, or as the source prints them"},
    "azimuth": {"long_name": "how columns follow the motion"},
    "mirror": {"long_name": "how the mirror's turn is taken out"},
    "range_filter": {"long_name": "what makes one range of a pixel's looks"},
    "source": {"long_name": "where a profile comes from"},
    "kind": {"long_name": "synthetic profile learned, synthetic test profile, or measured one"},
    "classifier": {"long_name": "who names the ship"},
    "column": {"units": "pixel", "long_name": "column of pixels, rightwards from the ship origin"},
}
ROW_OF_FLIGHTS = {"units": "pixel", "long_name": "row of pixels, upwards from the ship origin"}
ERRORS = {
    "error_parameter": {"long_name": "what is believed wrong of the flight"},
    "error_value": {
        "units": "1",
        "long_name": "how wrong: aircraft_speed in percent, ship_speed in m/s, others in degrees",
    },
}

VIEW = ("ship", "aspect")
CELL = ("pulse_width", "range", "target_free_ifovs")
TEMPLATE = ("coverage_rule", "inner_radius", "interpolation")
OF_SILHOUETTES = ("coverage_rule", "segmentation", "inner_radius", "interpolation")
CELL_INFRARED = (*OF_SILHOUETTES, "phase")
AVERAGE = ("replicate", "frame_count")
LOOK = ("range", "super_resolution", "frame_count")

# Dimensions only when they have several values; a single one is a scalar coordinate.
OF_MNN = ("epochs", "grow_every", "mnn_learning_rate", "tolerance", "inputs", "annealing")
OF_CORRELATION, OF_LIKELIHOOD = ("training", "left_out"), ("gain_sigma", "left_out")
# Of the silhouettes that go with profiles there is one way each, told in a scalar coordinate.
OF_FUSION = ("channel", "gain_sigma", *OF_SILHOUETTES, "super_resolution", "infrared_frame_count")
OF_FLIGHT = (
    *("depression", "aircraft_speed", "ship_speed", "aircraft_heading", "aircraft_track", "offset"),
    *("pointing", "mirror_angle", "ifov", "line_rate", "samples", "pulse_rate", "range_gate"),
    *("detectors", "jitter", "jitter_time", "transom_gain", "mast_gain"),
    *("cnr", "flown_pulse_width", "range_sigma", "threshold", "nedt"),
    *("error", "autofocus", "chain", "azimuth", "mirror", "range_filter"),
)
OPTIONAL = (
    *OF_MNN,
    "label_rule",
    "score_rule",
    "training",
    *OF_LIKELIHOOD,
    "learning_rate",
    "target_free_ifovs",
    "coverage_rule",
    "segmentation",
    "inner_radius",
    "interpolation",
    *OF_FLIGHT,
    "replicate",
)

WINDOW = {
    name: {"units": "m", "long_name": f"{name} place on the target, the ship origin within a pixel"}
    for name in ("vertical", "horizontal")
}
