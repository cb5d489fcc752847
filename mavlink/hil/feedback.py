"""What a plant sends its autopilot at every frame, by the word of the command line."""

from enum import StrEnum


class Feedback(StrEnum):
    """What the autopilot asks for, and flies by."""

    STATE = "state"
    """The true state."""
    SENSORS = "sensors"
    """What sensors measure: the autopilot estimates its state."""
