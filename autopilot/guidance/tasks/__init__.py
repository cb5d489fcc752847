"""Flight tasks: each way to fly (PX4's word), asked once a sample for a motion or an attitude."""
