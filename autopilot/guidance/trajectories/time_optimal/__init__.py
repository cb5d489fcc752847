"""The fastest flight through waypoints within a vehicle's limits."""
