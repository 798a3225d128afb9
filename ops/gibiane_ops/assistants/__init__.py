"""Independent cases of one instruction, on this process, on local workers, or on a Dask cluster."""
