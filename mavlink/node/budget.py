"""The work that a vehicle does for ground stations."""

SHARE = 0.25  # part of simulated time: the control law needs the rest at real time
MAX_SAVED_US = 2_000.0


class Budget:
    """Work in µs, estimated: with measured times no flight would repeat bit by bit. Excess is earned afterwards."""

    def __init__(self) -> None:
        self._left_us = MAX_SAVED_US
        self._earned_us = 0

    def allows(self, now_us: int) -> bool:
        """Whether more work may begin at simulated time `now_us`."""
        earned_us = SHARE * max(now_us - self._earned_us, 0)  # simulated time can restart
        self._earned_us = now_us
        self._left_us = min(self._left_us + earned_us, MAX_SAVED_US)
        return self._left_us > 0.0

    def spend(self, cost_us: float) -> None:
        self._left_us -= cost_us
