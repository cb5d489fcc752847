"""Checks before a flight, limits in flight, and phases."""
