"""Many flights side by side.

Comparisons, seeds, the thesis's figures, the studies of profile flight, verification.
"""
