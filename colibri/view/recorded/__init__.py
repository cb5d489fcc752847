"""Recorded flights: what is shown of their logs at a time, and the horizons that a replay predicts once more."""
