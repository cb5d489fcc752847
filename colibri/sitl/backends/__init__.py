"""Lockstep sessions of plant and autopilot."""
