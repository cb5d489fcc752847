"""The machine code of kernels on disk: where it is kept, what of it, and when it is renewed."""
