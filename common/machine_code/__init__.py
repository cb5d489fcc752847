"""Cache of compiled kernels on disk."""
