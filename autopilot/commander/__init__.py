"""Decisions put into effect.

The pilot, his supervisor, commands and missions of ground stations, the task of each mode.
"""
