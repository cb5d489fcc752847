"""Many flights side by side.

Comparisons, seeds, the thesis's figures, the studies of profile flight, verification.
"""

__all__: list[str] = []  # the command line's; nothing to import
