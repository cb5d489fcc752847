"""Which message goes to which channel how often, and the heartbeat."""
