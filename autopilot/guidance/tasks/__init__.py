"""Flight tasks: each way to fly (PX4's word), updated once a sample to a motion or an attitude."""
