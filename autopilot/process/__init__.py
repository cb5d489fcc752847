"""The autopilot as a process."""
