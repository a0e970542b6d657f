"""Stores: finished cells as labelled arrays of one zarr DataTree, with tables and provenance.

In come a plan whose cells are in the cache, and a place; out goes a store that is whole, or was
left as it was. `sweeping` is the complete sweep. The command and `function` may import it.
"""
