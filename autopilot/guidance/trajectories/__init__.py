"""Tracks as formulas of time, and their horizons."""
