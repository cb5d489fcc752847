"""Plant and autopilot: frames, commands, faults, and their protocols (lockstep, PX4's interface, stepped)."""
