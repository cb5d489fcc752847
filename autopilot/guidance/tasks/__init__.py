"""Flight tasks (PX4's term), each updated once a sample to a motion or an attitude."""
