"""What a plant sends its autopilot at every frame, by the word of the command line."""

from argparse import ArgumentTypeError
from enum import StrEnum


class Feedback(StrEnum):
    """What the autopilot asks for, and flies by."""

    STATE = "state"
    """The true state."""
    SENSORS = "sensors"
    """What sensors measure: the autopilot estimates its state."""


def feedback(text: str) -> Feedback:
    """Read a feedback of the command line."""
    try:
        return Feedback(text)
    except ValueError:
        raise ArgumentTypeError(f"must be {' or '.join(Feedback)}, not {text}") from None
