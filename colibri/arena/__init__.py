"""`colibri arena`: control laws on the same tracks, vehicles and disturbances, beside published values."""

__all__: list[str] = []  # the command line's; nothing to import
