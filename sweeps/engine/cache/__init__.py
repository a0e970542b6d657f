"""The cache: results by key, packed a batch to an object of a folder or a bucket.

Input: arrays with their keys. Output: the same arrays, or None where they are missing or damaged.
It knows no stage's function. `run` and the packages behind it may import it.
"""
