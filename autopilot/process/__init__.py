"""The autopilot as a process: frames answered, logs, ground links, state kept on disk."""
