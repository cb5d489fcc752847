"""What is no subcommand: their list and parser, options that several have, a flight and its report, both processes."""
