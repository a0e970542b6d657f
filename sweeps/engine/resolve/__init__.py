"""Resolving: from the words of a command line to the cells of a sweep and their keys.

Input: an experiment and overrides. Output: `Choices`, and a `Plan` with axes, cells and keys. It
reads no result. `cache` and the packages behind it may import it.
"""
