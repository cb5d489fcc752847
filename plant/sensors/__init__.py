"""Sensors of the plant: the true state in, measurements with errors and faults out."""
