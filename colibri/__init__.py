"""Colibri: a quadrotor autopilot by LPV model predictive control, and the plant it flies, over MAVLink."""

from colibri.common.errors import Error

__all__ = ["Error"]
