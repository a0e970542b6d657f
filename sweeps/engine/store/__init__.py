"""Stores: finished cells as labelled arrays of one zarr DataTree, with tables and provenance.

Input: a plan whose cells are in the cache, and a path. Output: a store, changed completely or not
at all. `sweeping`, `command` and `function` may import it.
"""
