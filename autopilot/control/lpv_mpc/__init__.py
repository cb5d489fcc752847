"""The flight profile's law: position with preview, attitude by constrained LPV-MPC, fallbacks."""
