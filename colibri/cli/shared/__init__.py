"""Parser, list of subcommands, and shared options."""
