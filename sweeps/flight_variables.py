"""What a store holds of flights: the variables of its groups `validation` and of what is named.

validation               profile, profile_correlation, mast_tilt, ..., intensity, signature
classification/measured  predicted, correct, ship_correct
status_measured          cell
tables/measured          accuracy of synthetic and measured profiles
"""

from __future__ import annotations

from typing import Any

from sweeps.axes import OF_FLIGHT, VIEW

VALIDATION, MEASURED, STATUS_MEASURED, TABLES_MEASURED = (
    "validation",
    "classification/measured",
    "status_measured",
    "tables/measured",
)
FLIGHT_GROUPS = (VALIDATION, MEASURED, STATUS_MEASURED, TABLES_MEASURED)

SOURCES = ("measured", "noiseless", "synthetic", "point")
KINDS = ("learned", "test", "measured")

FLIGHT = ("range", *OF_FLIGHT, "replicate")
CELL_MEASURED = ("pulse_width", "depression")
_LANDMARK = (*VIEW, *FLIGHT, "source")
_IMAGE = (*VIEW, *FLIGHT, "row", "column")
_METRE, _DEGREE = {"units": "m"}, {"units": "degree"}

Row = tuple[Any, ...]  # a name, axes, a meaning, what differs from the others

OF_VIEWS: tuple[Row, ...] = (
    (
        "profile",
        (*VIEW, *FLIGHT, "source", "down_range"),
        "range profile: intensity summed over pixels, in noise powers of one look",
    ),
    (
        "profile_correlation",
        (*VIEW, *FLIGHT),
        "correlation of the measured profile with the noiseless one",
    ),
    (
        "profile_correlation_without_hangar",
        (*VIEW, *FLIGHT),
        "the same without 4 m either side of the hangar, the highest peak",
    ),
    (
        "mast_tilt",
        (*VIEW, *FLIGHT),
        "tilt of masts in the corrected images, intensity and infrared together",
        _DEGREE,
    ),
    (
        "waterline_tilt",
        (*VIEW, *FLIGHT),
        "tilt of the waterline in the corrected images, intensity and infrared together",
        _DEGREE,
    ),
    (
        "mast_tilt_error",
        (*VIEW, *FLIGHT),
        "standard error of that of masts, where what is left is a shear of a few degrees at most",
        _DEGREE,
    ),
    (
        "waterline_tilt_error",
        (*VIEW, *FLIGHT),
        "standard error of that of the waterline, likewise",
        _DEGREE,
    ),
    (
        "noiseless_mast_tilt",
        (*VIEW, *FLIGHT),
        "tilt of masts in the corrected noiseless scan, by how much ship each pixel shows",
        _DEGREE,
    ),
    (
        "noiseless_waterline_tilt",
        (*VIEW, *FLIGHT),
        "tilt of the waterline in the corrected noiseless scan, likewise",
        _DEGREE,
    ),
    (
        "hangar_spike_offset",
        (*VIEW, *FLIGHT),
        "down-range of the hangar's spike measured, over that without noise",
        _METRE,
    ),
    ("stern_to_hangar", _LANDMARK, "from the stern end to the hangar's spike", _METRE),
    (
        "stern_to_bridge",
        _LANDMARK,
        "from the stern end to the front of the forward structure",
        _METRE,
    ),
    ("transom_ratio", _LANDMARK, "height of the highest within 5 m of the stern over the hangar's"),
    ("mast_position", _LANDMARK, "main mast, past the hangar", _METRE),
    ("mast_ratio", _LANDMARK, "height of the main mast's peak over the hangar's"),
    ("forward_position", _LANDMARK, "peak of the forward block, past the hangar", _METRE),
    ("forward_ratio", _LANDMARK, "height of the forward block's peak over the hangar's"),
    ("transom_energy", _LANDMARK, "returns within 1.5 m of the transom's peak over the hangar's"),
    ("mast_energy", _LANDMARK, "returns within 1.5 m of the main mast's peak over the hangar's"),
    ("forward_energy", _LANDMARK, "returns within 1.5 m of the forward peak over the hangar's"),
    ("deck_spikes", _LANDMARK, "peaks between the transom and the hangar"),
    (
        "closing_speed_error",
        (*VIEW, *FLIGHT),
        "closing speed that images are corrected with over the true one, less 1",
    ),
    ("looks", (*VIEW, *FLIGHT), "mean samples of the pixels that have some"),
    ("intensity", _IMAGE, "corrected, segmented intensity in noise powers, 0 where there is none"),
    ("range_image", _IMAGE, "range less that of the ship origin, of the same pixels", _METRE),
    (
        "infrared_image",
        _IMAGE,
        "apparent temperature over the sea's, of the same pixels",
        {"units": "K"},
    ),
    (
        "signature",
        (*VIEW, *FLIGHT, "pulse_width", "kind", "down_range"),
        "range profile of the proposed sensor, noise floor included",
    ),
)

_TEST = (*CELL_MEASURED, "classifier", "vigilance", *(a for a in FLIGHT if a != "depression"))
ANSWER = (*_TEST, "kind", *VIEW)

OF_ANSWERS: tuple[Row, ...] = (
    ("predicted", ANSWER, "ship named, as an index into the ship axis"),
    (
        "correct",
        ANSWER,
        "1 where the answer is right: the ship, of the multilayered network its aspect bin, too",
        {"dtype": "i1"},
    ),
    ("ship_correct", ANSWER, "1 where the ship is right", {"dtype": "i1"}),
)
