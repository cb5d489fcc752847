"""Subcommands about a control law."""
