"""Many flights at once: campaigns, comparisons, studies."""
