"""How fast it flies: each stage of a control step, flights at several rates, ground stations served."""

__all__: list[str] = []  # the command line's; nothing to import
