"""Processes killed in flight, again and again."""
