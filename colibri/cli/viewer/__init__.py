"""Subcommands that show flights in a browser."""
