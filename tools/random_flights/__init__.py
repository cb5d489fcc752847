"""Flights drawn at random: vehicles, weather, parameters, modes, failures."""
