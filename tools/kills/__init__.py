"""Processes killed in flight, again and again: the vehicle's motion meanwhile, and the end of its flight."""
