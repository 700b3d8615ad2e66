"""Parallel work on other machines, or on a cluster of this one, by dask.distributed."""
