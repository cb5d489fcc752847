"""Supervision: checks before a flight, limits in flight, and the table of phases."""
