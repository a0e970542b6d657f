"""The command line of an experiment: help, sweeps, dry runs, status, and the exit status.

Input: the words of a command line. Output: a store, lines on the screen and an exit status. No
other package imports it.
"""

from sweeps.engine.command.line import Command

__all__ = ["Command"]
