"""Resolving: from the words of a command line to the cells of a sweep and their keys.

In come an experiment and overrides; out go `Choices`, and a `Plan` with the axes, the cells of each
stage and the key of each cell, in which the code of its stage counts. It reads no result. The rooms
from the cache on may import it.
"""
