"""Telemetry: a snapshot of the vehicle -> the fields of each message, in wire units and frames."""
