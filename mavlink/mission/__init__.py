"""The mission protocol: items, upload, and the service for missions, fences and rally points."""
