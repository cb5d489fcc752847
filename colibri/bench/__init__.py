"""Speed of Colibri."""

__all__: list[str] = []  # the command line's; nothing to import
