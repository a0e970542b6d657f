"""One plain function over a grid: `sweeps.sweep`.

Input: a function and values of its arguments. Output: an xarray data set of a store. No other
package imports it.
"""
