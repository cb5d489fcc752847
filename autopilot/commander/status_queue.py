"""Queue of status texts."""


class StatusQueue:
    """MAV_SEVERITY and text of each line, in order."""

    def __init__(self) -> None:
        self._lines: list[tuple[int, str]] = []

    def say(self, severity: int, text: str) -> None:
        self._lines.append((severity, text))

    def take(self) -> list[tuple[int, str]]:
        lines, self._lines = self._lines, []
        return lines
