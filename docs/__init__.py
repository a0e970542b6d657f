"""The documentation: pages, their pictures and tables."""
