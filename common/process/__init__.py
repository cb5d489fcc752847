"""Process support: arguments, signals, exit codes, status lines, log files, crash-safe slots."""
