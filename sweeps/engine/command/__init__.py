"""The command line of an experiment: help, sweeps, dry runs, status, and the exit status.

In come the words of a command line; out go a store, lines on the screen and an exit status. No
other room imports it.
"""

from sweeps.engine.command.line import Command

__all__ = ["Command"]
