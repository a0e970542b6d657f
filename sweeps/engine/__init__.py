"""A small sweep engine: settings, stages, cells and cubes. Independent of what is swept."""
