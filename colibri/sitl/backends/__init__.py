"""Lockstep sessions of plant and autopilot, in memory or as processes, with link faults."""
