"""Engines: a pool of processes, or a Dask cluster."""
