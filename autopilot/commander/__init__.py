"""Commander: decides the flight mode, the failsafes and the flown task.

`rules` holds pure tables and rules: modes and their transitions, arming checks, failsafe conditions and actions. The
documentation is generated from these tables.

`Pilot` is the state machine. Once a control sample, the `Supervisor` evaluates the failsafe table on the conditions,
and the pilot executes the action if it outranks the active one. The pilot then updates the task of its mode, moves the
reference towards the task's target (`flight.reference_generator`), and detects take-off and landing
(`flight.ground_contact`).

`Commands` and `MotionCommands` check MAVLink commands against the needs of modes (`needs`), the fence and the limits,
and return a `Refusal` if they fail. `Missions` holds the uploaded plans; `mode_tasks` creates the task of each mode,
also after a restart from a checkpoint.
"""
