"""Wiring of the library into Hydra-configured, dask-run, zarr-stored parameter sweeps."""
