"""A sweep engine: settings and stages are declared once, and each cell is computed once.

It knows no experiment. Each of its packages imports only from earlier ones: `declare`, `resolve`,
`cache`, `run`, `store`, the module `sweeping`, then `command` and `function`. Users declare
experiments with the names in `sweeps`.
"""
