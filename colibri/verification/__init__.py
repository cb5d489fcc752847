"""Flights that must be the same bit for bit: twice, and as they once were, on every computer."""
