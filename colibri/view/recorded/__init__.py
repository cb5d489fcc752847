"""Recorded flights: state from their logs, and horizons from a replay."""
