"""Declarations: settings, stages and tables of an experiment, and their checks.

Input: the classes and functions of a user's module. Output: checked `Setting`, `Stage`, `Table` and
`Experiment`, without values. Every other package may import it.
"""
