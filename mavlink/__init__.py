"""The vehicle side of MAVLink: codec, links, and the conversations as state machines without input or output."""
