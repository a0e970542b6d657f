"""The command `ncti-report` for `forked`, with the command's lazy imports done in advance."""

import sys

import dask.base  # noqa: F401
import jinja2  # noqa: F401
import obstore  # noqa: F401
import pandas  # noqa: F401
import rich.console  # noqa: F401
import xarray  # noqa: F401
import zarr  # noqa: F401

import sweeps.report.article_columns
import sweeps.report.pictures
import sweeps.report.summary  # noqa: F401
from sweeps.report import command


def main(arguments):
    """Run the command, which exits by itself unless it succeeds."""
    sys.argv = ["ncti-report", *arguments]
    command.main()
