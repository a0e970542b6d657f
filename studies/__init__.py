"""Studies: questions asked with the library, each a package with its stages and experiments.

A study joins `ncti-sweep` by an entry point, as any installed package may, and imports no other.

- `benchmark`: how well classifiers name ships on splits that cannot leak
- `operate`: settings of both sensors that suffice
- `reproduction`: how far the article's tables follow from its stated parameters
- `run_time`: run time against error of every rendering engine
- `scan`: how long a search of a field of regard takes
"""
