"""Sensors that the filter fuses without delay, one file each."""
