"""What MAVSDK-Python's examples that do not fly must have brought about."""

import re

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import mav
from tests.clients.support.example_flights import Evidence


class PlanJudge:
    """Demands plans of a number of items."""

    def __init__(self, missions: int, rally: int, fence: int) -> None:
        """Demand so many items of each plan."""
        self._wanted = (missions, rally, fence)
        self.__doc__ = "The vehicle has " + " and ".join(
            f"{count} {name}"
            for count, name in zip(self._wanted, ("mission items", "rally points", "fence items"), strict=True)
            if count
        )

    def __call__(self, evidence: Evidence) -> None:
        """Ask the vehicle."""
        kinds = (mav.MAV_MISSION_TYPE_MISSION, mav.MAV_MISSION_TYPE_RALLY, mav.MAV_MISSION_TYPE_FENCE)
        assert tuple(map(evidence.seen.plan_length, kinds)) == self._wanted


class PrintJudge:
    """Demands that a script prints something, so often."""

    def __init__(self, pattern: str, times: int, shows: str) -> None:
        """Demand a regular expression."""
        self._pattern, self._times = pattern, times
        self.__doc__ = shows

    def __call__(self, evidence: Evidence) -> None:
        """Wait for it."""
        evidence.client.wait_printed(self._pattern, times=self._times)


class HeardJudge:
    """Demands that what a script sends is routed to the other ground station."""

    def __init__(self, name: str, times: int) -> None:
        """Demand so many messages of that name."""
        self._name, self._times = name, times
        self.__doc__ = f"{times} × {name} reach the other ground station"

    def __call__(self, evidence: Evidence) -> None:
        """Count them."""
        assert evidence.seen.counts[self._name] >= self._times, evidence.seen.counts


def calibration(evidence: Evidence) -> None:
    """All four calibrations come to their end."""
    for kind in ("gyro", "accel", "mag", "level"):
        assert f"[cal] calibration done: {kind}" in evidence.seen.texts


def all_params(evidence: Evidence) -> None:
    """Every parameter is printed."""
    count = evidence.seen.request("PARAM_VALUE", "PARAM_REQUEST_READ", "", 0).param_count
    assert len(re.findall(r"(?m)^[A-Z][A-Z0-9_]*: [-\d.e]+$", evidence.client.printed)) == count


def logs(evidence: Evidence) -> None:
    """The log of the flight before is the file that the vehicle keeps, byte for byte."""
    kept = sorted((evidence.state / "0" / "logs").iterdir())
    got = sorted(evidence.client.folder.glob("log-*.ulog"))
    assert kept
    assert [path.read_bytes() for path in got] == [path.read_bytes() for path in kept]
    assert len(got[0].read_bytes()) > 50_000


def uploaded_parameters(evidence: Evidence) -> None:
    """The vehicle has the numbers of the file."""
    assert evidence.seen.parameter("MIS_TAKEOFF_ALT") == 7.5
    assert evidence.seen.parameter("RTL_RETURN_ALT") == 42.0


def untouched(evidence: Evidence) -> None:
    """The vehicle stands as before."""
    now = evidence.seen.now
    assert (now.mode, now.armed, now.flying) == (Mode.HOLD, False, False)
