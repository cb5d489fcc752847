"""The airframe as data: numbers with units and source; the one door that the autopilot may use."""
