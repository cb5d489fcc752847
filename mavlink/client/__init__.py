"""The client side of MAVLink, for ground stations, companion computers and tests; without I/O."""
