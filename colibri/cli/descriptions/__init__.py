"""Subcommands about files of profiles and vehicles."""
