"""Commander: decides the flight mode, the failsafes and the flown task.

`rules` holds the tables of modes, arming checks and failsafes, which the documentation is generated from.

`Pilot` is the state machine. Once a control sample, the `Supervisor` evaluates the failsafe table, and the
pilot executes an action that outranks the active one. The pilot then updates the task of its mode, moves the reference
towards the task's target (`flight.reference_generator`), and detects take-off and landing (`flight.ground_contact`).

`Commands` and `MotionCommands` check MAVLink commands against the needs of modes (`needs`), the fence and the limits.
`Missions` holds the uploaded plans; `mode_tasks` creates the task of each mode, also after a restart.
"""
