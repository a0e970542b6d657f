"""Time delay and integration: one image of a row of detectors that trail each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def time_delay_integrate(samples: ArrayLike) -> NDArray[np.float64]:
    """Mean over the detectors of what each saw of the same place.

    Parameters
    ----------
    samples : (detector, line, sample) array_like
        Passive samples [K], the leading detector first. Each trails the one before it by one
        sample: detector k sees column j - k at sample j.

    Returns
    -------
    (line, sample) float64 ndarray
        Apparent temperature [K] of the columns that the leading detector sees. The last
        ones, which the scan ends before all have seen, are the mean of those that have.

    Raises
    ------
    ValueError
        If there is no detector, or no axis of lines or samples.

    Notes
    -----
    Article, 'The Infrared Airborne Radar (IRAR) System' and 'Data Enhancement and Compensation':
    the array was turned to scan along its length and delayed in software. The noise of n
    detectors is independent, so that the signal-to-noise ratio gains sqrt(n), 12 detectors
    3.46.

    Only whole delays. Between samples one would have to interpolate, which averages neighbouring
    samples of a detector: noise falls below 1/sqrt(n) only because the image is blurred, and
    neighbouring pixels share it. A gain measured pixel by pixel would flatter the sensor.
    """
    frames = np.asarray(samples, dtype=np.float64)
    if frames.ndim != 3 or len(frames) == 0:
        raise ValueError(
            f"samples has shape {frames.shape}, but must be lines and samples of at least one "
            "detector"
        )
    length = frames.shape[-1]
    total = np.zeros(frames.shape[1:])
    seen = np.zeros(length)
    for detector, frame in enumerate(frames):
        kept = max(0, length - detector)
        total[:, :kept] += frame[:, detector:]
        seen[:kept] += 1
    return total / seen
