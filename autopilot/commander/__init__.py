"""Modes, failsafes, commands and missions: decisions on what the vehicle flies next."""
