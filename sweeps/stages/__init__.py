"""Declarations of this experiment: one module per sensor and per classifier, with their tables."""
