"""What is no subcommand: options that several have, a flight with its progress and report, the two processes."""
