"""The mission protocol: items, upload, download, one service for mission, fence and rally points."""
