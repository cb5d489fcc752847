"""Flights for fuzzing, soaking and tests: a vehicle in this process, processes, relays, observers."""
