"""What does many jobs at once: a pool of processes on this computer, or a cluster of Dask."""
