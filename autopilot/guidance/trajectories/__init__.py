"""Tracks as formulas of time with every derivative, waypoints with minimum snap, sampled as horizons."""
