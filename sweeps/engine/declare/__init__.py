"""Declarations: settings, stages and tables of an experiment, and their checks.

In come the classes and functions of a user's module; out go `Setting`, `Stage`, `Table` and
`Experiment`, which are checked and know no value yet. Every other room may import it.
"""
