"""Flight stacks as values: modes, messages, parameters, thrust and response of PX4, ArduPilot and Colibri."""
