"""Flights of any length in bounded memory."""
