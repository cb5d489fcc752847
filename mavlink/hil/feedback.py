"""The plant's output to the autopilot."""

from enum import StrEnum


class Feedback(StrEnum):
    """The basis of the autopilot's flight."""

    STATE = "state"  # the true state
    SENSORS = "sensors"  # sensor measurements, from which the autopilot estimates its state
