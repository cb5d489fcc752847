"""Exceptions thrown into each part of a flight: what flies on, what lands, what is said."""
