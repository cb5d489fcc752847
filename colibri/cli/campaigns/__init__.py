"""Subcommands that fly many flights."""
