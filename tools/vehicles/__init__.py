"""Flights of every vehicle of a folder, in memory."""
