"""The autopilot: planner, LPV-MPC control law, and the process that flies a plant with them."""
