"""Bytes to MAVLink messages and back: dialect, framing, signing, telemetry-log format, the only NED/FRD."""
