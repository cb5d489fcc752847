"""The autopilot as a pure composition: a frame in, a command out; with or without ground stations; its checkpoint."""
