"""What MAVSDK-Python's examples that do not fly must have brought about."""

import re
from collections.abc import Callable
from typing import TypeAlias

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import mav
from tests.clients.support.example_flights import Evidence

Judge: TypeAlias = Callable[[Evidence], None]


def plans(missions: int, rally: int, fence: int) -> Judge:
    kinds = (mav.MAV_MISSION_TYPE_MISSION, mav.MAV_MISSION_TYPE_RALLY, mav.MAV_MISSION_TYPE_FENCE)
    wanted = {"mission items": missions, "rally points": rally, "fence items": fence}

    def judge(evidence: Evidence) -> None:
        assert list(map(evidence.seen.plan_length, kinds)) == list(wanted.values())

    judge.__doc__ = "The vehicle has " + " and ".join(f"{count} {name}" for name, count in wanted.items() if count)
    return judge


def prints(pattern: str, times: int, shows: str) -> Judge:
    def judge(evidence: Evidence) -> None:
        evidence.client.wait_printed(pattern, times=times)

    judge.__doc__ = shows
    return judge


def airspeeds(evidence: Evidence) -> None:
    """20 × AIRSPEED reach the other ground station."""
    assert evidence.seen.counts["AIRSPEED"] >= 20, evidence.seen.counts


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
