"""Check that Colibri can fly on this computer."""

__all__: list[str] = []  # the command line's; nothing to import
