"""Plant and autopilot brought together frame by frame, in memory or as processes, and what links do to datagrams."""
