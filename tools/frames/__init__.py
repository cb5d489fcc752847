"""Time of a frame, whatever ground stations request."""
