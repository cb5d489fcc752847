"""What plant and autopilot tell each other.

Frames, commands, faults, and the conversations (lockstep, PX4's interface, stepped).
"""
