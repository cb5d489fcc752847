"""Sensors to state: the error-state Kalman filter, its fault monitors, what is published and how good it is."""
