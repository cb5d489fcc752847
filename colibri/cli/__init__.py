"""The one command: a file a subcommand, each with its options and its call."""
