"""ArduPilot's log of a flight, DataFlash `.BIN`."""
