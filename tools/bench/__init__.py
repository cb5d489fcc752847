"""RotorPy, a peer to measure beside."""
