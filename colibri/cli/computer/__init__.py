"""Subcommands about this computer."""
