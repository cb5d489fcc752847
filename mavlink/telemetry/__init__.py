"""Telemetry: a snapshot of the vehicle -> the fields of each message that tells of it, in wire units and frames."""
