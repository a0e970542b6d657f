"""Time delay and integration: one image from a row of detectors that trail each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def time_delay_integrate(samples: ArrayLike) -> NDArray[np.float64]:
    """Average the samples that passive detectors take of the same place.

    Parameters
    ----------
    samples : (detector, line, sample) array_like
        Passive samples [K], the leading detector first. Each trails the one before it by one
        sample: detector k sees column j - k at sample j.

    Returns
    -------
    (line, sample) float64 ndarray
        Apparent temperature [K] of the columns that the leading detector sees. The last columns,
        which not all detectors reach before the scan ends, are means over those that do.

    Raises
    ------
    ValueError
        If there is no detector, or no axis of lines or samples.

    See Also
    --------
    correct : The correction chain, which includes this step.

    Notes
    -----
    The array was turned to scan along its length and delayed in software [1]_. The noise of n
    detectors is independent, so the signal-to-noise ratio gains sqrt(n), 3.46 for 12 detectors.

    Delays are whole samples. A delay between samples would need interpolation, which averages
    neighbouring samples of a detector: noise falls below 1/sqrt(n) only because the image is
    blurred and neighbouring pixels share noise, and a gain measured pixel by pixel would overstate
    the sensor.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'The Infrared Airborne Radar (IRAR) System' and 'Data
       Enhancement and Compensation'.

    Examples
    --------
    Twelve detectors of 0.4 K noise each:

    >>> import numpy as np
    >>> samples = np.random.default_rng(0).normal(0.0, 0.4, (12, 50, 111))
    >>> print(f"{time_delay_integrate(samples)[:, :100].std():.2f} K")
    0.12 K
    """
    frames = np.asarray(samples, dtype=np.float64)
    if frames.ndim != 3 or len(frames) == 0:
        raise ValueError(
            f"samples has shape {frames.shape}, but must be lines and samples of at least one "
            "detector"
        )
    length = frames.shape[-1]
    total = np.zeros(frames.shape[1:])
    count = np.zeros(length)
    for detector, frame in enumerate(frames):
        columns = max(0, length - detector)
        total[:, :columns] += frame[:, detector:]
        count[:columns] += 1
    return total / count
