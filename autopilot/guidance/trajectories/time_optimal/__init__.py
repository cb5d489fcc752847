"""The fastest flight through waypoints within a vehicle's limits: optimised leg times and points in between."""
