"""Tracks as formulas of time with all derivatives, waypoints with minimum snap, horizons."""
