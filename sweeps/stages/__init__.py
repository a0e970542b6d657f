"""What this experiment declares: a module a sensor, a module a classifier, with their tables."""
