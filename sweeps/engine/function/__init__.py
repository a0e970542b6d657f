"""One plain function over a grid: `sweeps.sweep`.

In come a function and values of its arguments; out goes an xarray data set of a store. No other
room imports it.
"""
