"""Parser, list of subcommands, shared options, and the two processes."""
