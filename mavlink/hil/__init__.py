"""What plant and autopilot send each other.

Frames, commands, faults, and the conversations (lockstep, PX4's interface, stepped).
"""
