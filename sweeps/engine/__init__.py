"""A sweep engine: settings and stages are declared once, and each cell is computed once.

It knows no experiment. Each of its packages imports only from those before it: `declare`,
`resolve`, `cache`, `run`, `store`, the module `sweeping`, then `command` and `function`. The names
with which users declare experiments are those of `sweeps`.
"""
