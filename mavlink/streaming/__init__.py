"""Message rates per channel, and the heartbeat."""
