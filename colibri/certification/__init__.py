"""Certificates of control laws, checked in exact arithmetic."""

__all__: list[str] = []  # the command line's; nothing to import
