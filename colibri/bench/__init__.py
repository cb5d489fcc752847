"""Speed of Colibri: stages of a control step, flights at several rates, ground stations."""

__all__: list[str] = []  # the command line's; nothing to import
