"""Parameters, and the control law that is rebuilt on a change."""
