"""Recorded flights and their horizons."""
