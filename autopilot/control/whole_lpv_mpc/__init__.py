"""The whole vehicle's control law: position, attitude and rotors in one LPV-MPC."""
