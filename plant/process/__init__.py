"""The plant as a process: lockstep and free-running servers, ArduPilot's and PX4's, pace and logs."""
