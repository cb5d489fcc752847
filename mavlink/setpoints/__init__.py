"""Streamed input of clients: offboard setpoints, sticks, a target to follow, and arbitration between clients."""
