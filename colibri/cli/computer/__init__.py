"""Subcommands about this computer: whether it can fly, how fast, and what its shell completes."""
