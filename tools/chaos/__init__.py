"""Exceptions thrown into each part of a flight."""
