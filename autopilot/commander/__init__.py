"""Commander: decides the flight mode, the failsafes and the flown task.

Once a control sample, the `Supervisor` evaluates the table of failsafes, and the `Pilot`, the state machine, executes
an action that outranks the active one. It then updates the task of its mode, moves the reference towards the task's
target, and detects take-off and landing (`flight`). `Commands` check MAVLink commands against the needs of modes, the
fence and the limits. `Missions` holds the uploaded plans; `mode_tasks` creates the task of each mode.
"""
