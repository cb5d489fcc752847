"""Flights that must be reproduced bit for bit: twice, and as recorded."""

__all__: list[str] = []  # the command line's; nothing to import
