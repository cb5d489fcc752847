"""Processes that die in flight, again and again: what the vehicle does meanwhile, and whether its flight ends."""
