"""A MAVLink component: channels, routing, and the interface of its services."""
