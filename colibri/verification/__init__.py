"""Flights that must be the same bit for bit: twice, and as they once were, on every computer."""

__all__: list[str] = []  # the command line's; nothing to import
