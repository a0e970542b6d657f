"""A small sweep engine: settings, stages, cells and cubes. It knows nothing of what is swept."""
