"""Ship identification by laser radar and passive infrared: pure functions from ship to score.

Packages, in the order of the data flow, each imported when it is first used:

- `ships`: ships by name, or from a user's own sheet or mesh
- `render`: range images of a ship, by pixels or exact along lines
- `ladar`: range profiles of the laser radar, with speckle and noise
- `infrared`: silhouettes and thermal images, their contrast and noise
- `irar`: flights of the infrared airborne radar, and corrections of their scans
- `features`: profile vectors, segmented silhouettes and log-polar maps
- `classify`: classifiers of such vectors, as scikit-learn estimators
- `evaluate`: accuracy with confidence intervals
- `data`: labelled data sets of many rows, for training and comparing classifiers

`simulate` joins the first of them: one call returns a range profile, an infrared image or a flight
as an xarray object, with units, ready to plot. `ncti.dataset`, `ncti.load_xy` and
`ncti.to_numpy` are functions of `data`.

Examples
--------
The range profile of a ship at 100 km, averaged over 16 frames, and its features by hand:

>>> import numpy as np
>>> import ncti
>>> profile = ncti.simulate.range_profile("duncan", aspect=37, pulse_width=30e-9, frames=16)
>>> ship = ncti.ships.load("duncan")
>>> lines = ncti.render.line_image(ship, aspect=37, depression=3.84)
>>> extent = ncti.ladar.range_extent(lines, slant_range=100e3)
>>> expected = ncti.ladar.expected_profile(extent, pulse_width=30e-9, cnr=10**3.2)
>>> vector = ncti.features.profile_vector(expected)
>>> bool(np.corrcoef(vector, profile.expected)[0, 1] > 0.999)
True
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ncti import (
        classify,
        data,
        evaluate,
        features,
        infrared,
        irar,
        ladar,
        render,
        ships,
        simulate,
    )
    from ncti.data import dataset as dataset
    from ncti.data import load_xy as load_xy
    from ncti.data import to_numpy as to_numpy

__all__ = [
    "classify",
    "data",
    "evaluate",
    "features",
    "infrared",
    "irar",
    "ladar",
    "render",
    "ships",
    "simulate",
]

DATA_FUNCTIONS = ("dataset", "load_xy", "to_numpy")
"""Functions of `data` that this package re-exports."""


def __getattr__(name: str) -> Any:
    # Imported on first access, so that using one package does not wait for the others.
    if name in __all__:
        return import_module(f"{__name__}.{name}")
    if name in DATA_FUNCTIONS:
        return getattr(import_module(f"{__name__}.data"), name)
    if name == "__version__":
        from importlib.metadata import version

        return version("ncti-sweep")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    special = (name for name in globals() if name.startswith("__"))
    return sorted({*special, *__all__, *DATA_FUNCTIONS, "__version__"})
