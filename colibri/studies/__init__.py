"""Comparisons, seeds, the thesis's figures, studies."""

__all__: list[str] = []  # the command line's; nothing to import
