"""Geodesy, standard atmosphere, magnetic field, home."""
