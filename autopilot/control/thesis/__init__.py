"""The thesis's two strategies, as printed."""
