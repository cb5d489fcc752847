"""The client side of MAVLink: what a ground station, a companion computer or a test asks of a vehicle. No I/O."""
