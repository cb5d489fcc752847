"""One MAVLink component: its channels, routing between them, and the interface of its services."""
