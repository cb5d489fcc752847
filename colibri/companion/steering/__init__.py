"""From a state to a setpoint."""
