"""A vehicle's MAVLink microservices, each a state machine without I/O in its own file."""
