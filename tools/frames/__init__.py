"""The time that a frame takes of the autopilot, whatever ground stations request."""
