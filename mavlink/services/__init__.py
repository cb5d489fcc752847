"""The MAVLink microservices of a vehicle, each a state machine without input or output, in a file of its own."""
