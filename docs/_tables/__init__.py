"""Writers of the tables of README.md and the pages, by `python -m docs._tables`."""
