"""Exceptions thrown into each part of a flight, and the outcome of each flight."""
