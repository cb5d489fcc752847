"""What a process shares with the world.

Arguments, signals and exit codes, status lines, log files, crash-safe slots.
"""
