"""The autopilot as a process: frames, logs, ground links, state on disk."""
