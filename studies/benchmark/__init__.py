"""The benchmark: classifiers on splits that cannot leak."""
