"""The cache: results by key, packed a batch to an object of a folder or a bucket.

In come records of arrays with their keys; out go the same arrays, or the word that they are missing
or damaged. It knows no stage's function. The rooms from `run` on may import it.
"""
