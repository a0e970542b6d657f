"""The laser radar's beam and signal, by default the article's."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Beam:
    """IFOVs, range bins and range window of the laser radar.

    Attributes
    ----------
    ifov : float
        Side of the square instantaneous field of view [rad].
    bin_width : float
        Width of a range bin [m].
    window : float
        Length of the range window [m], centred on the ship origin.

    See Also
    --------
    extent_within : Range extent of a ship in one.

    Notes
    -----
    The defaults are those of [1]_.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Appendix 1.

    Examples
    --------
    >>> from ncti.ladar import Beam
    >>> Beam(bin_width=0.5)
    Beam(ifov=0.00015, bin_width=0.5, window=250.0)
    """

    ifov: float = 150e-6
    bin_width: float = 1.0
    window: float = 250.0


@dataclass(frozen=True)
class Signal:
    """Pulse, carrier and noise of a frame, as keyword arguments of `ncti.ladar` functions.

    `pulse_width` is the full width at 1/e^2 of the intensity [s], `cnr` the power ratio of a filled
    IFOV, and `target_free_ifovs` the number of IFOVs in a frame besides the ship's.
    """

    pulse_width: float = 30e-9
    cnr: float = 10**3.2
    target_free_ifovs: int = 4000
