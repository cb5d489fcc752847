"""Flight tasks, PX4's term."""
