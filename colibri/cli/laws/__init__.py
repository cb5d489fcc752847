"""Subcommands about a control law itself: what it must satisfy, and what can be proven of it."""
