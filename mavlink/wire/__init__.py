"""Bytes ⇄ MAVLink messages: dialect, framing, signing, telemetry logs, NED/FRD."""
