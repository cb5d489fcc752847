"""Parameters of control law, vehicle, behaviour and failsafes, and the law rebuilt on a change."""
