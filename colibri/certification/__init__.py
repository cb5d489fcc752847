"""Certificates of control laws: Lyapunov functions by semidefinite programs, checked in exact arithmetic."""

__all__: list[str] = []  # the command line's; nothing to import
