"""Suites on a Dask cluster."""
