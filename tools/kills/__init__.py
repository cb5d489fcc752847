"""Processes killed in flight, again and again: motion of the vehicle, end of its flight."""
