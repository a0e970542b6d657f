"""Simulation of one ship by one sensor: labelled results with units, ready to plot.

Examples
--------
>>> import ncti
>>> profile = ncti.simulate.range_profile("duncan", aspect=37)
>>> profile.dims
('down_range',)

`profile.plot()` draws it, and `profile.expected.plot()` adds the average of many frames.
"""

from ncti.simulate.flights import flight
from ncti.simulate.images import infrared_image
from ncti.simulate.profiles import range_profile

__all__ = ["flight", "infrared_image", "range_profile"]
