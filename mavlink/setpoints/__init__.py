"""What clients ask for from moment to moment: offboard setpoints, sticks, a target to follow, and whose is obeyed."""
