"""Vehicles, processes, relays and observers for tests and tools."""
