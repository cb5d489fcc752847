"""Every way in which a companion's flight ends, provoked on real PX4 with its own physics, one after another.

`python -m tests.peers.endings PROGRAM FOLDER`, in a network namespace with loopback alone. What happened is in
FOLDER/endings.json; all times are the vehicle's.
"""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.loading import load_track
from colibri.companion.guide import Companion
from colibri.companion.settings import CompanionSettings
from colibri.companion.stack import HOLD
from colibri.companion.supervision.phases import CompanionPhase
from colibri.companion.supervision.rules import FlightLimits
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import load_vehicle
from tests.peers.half_speed import PATIENT, Bench, own_physics

RETURN = (1.0, 4.0, 5.0)  # the mode that the pilot chooses; PX4 leaves those that need sticks at once where it has none
GIVE_UP_S = 90.0
FLIES_S = 3.0


class Case(NamedTuple):
    limits: FlightLimits
    disturb: Callable[["Bench"], None]


def _nothing(bench: Bench) -> None:
    del bench


def _interrupt(bench: Bench) -> None:
    assert bench.companion is not None, "it flies"
    bench.companion.stop("interrupted")


CASES: dict[str, Case] = {
    "pilot": Case(PATIENT, lambda bench: bench.order(mav.MAV_CMD_DO_SET_MODE, *RETURN)),
    "interrupted": Case(PATIENT, _interrupt),
    "late states": Case(FlightLimits(min_pace=0.01, max_gap_s=1.0), lambda bench: bench.freeze(0.3)),
    "box": Case(FlightLimits(margin_m=0.05, max_state_age_s=0.6, min_pace=0.01, max_gap_s=1.0), _nothing),
    "tilt": Case(FlightLimits(max_tilt_deg=12.0, max_state_age_s=0.6, min_pace=0.01, max_gap_s=1.0), _nothing),
    "error": Case(FlightLimits(max_error_m=0.02, max_state_age_s=0.6, min_pace=0.01, max_gap_s=1.0), _nothing),
    "estimate lost": Case(PATIENT, lambda bench: bench.set("SIM_GPS_USED", 0)),
}
TRACK = "lemniscate:lap=10"


def main(program: str, folder: Path) -> None:
    ended: dict[str, dict[str, Any]] = {}
    with own_physics(Path(program), folder) as bench:
        for number, (name, case) in enumerate(CASES.items()):
            ended[name] = fly(bench, case, may_arm=number == 0)
            (folder / "endings.json").write_text(json.dumps(ended, indent=1), encoding="utf-8")


def fly(bench: Bench, case: Case, *, may_arm: bool) -> dict[str, Any]:
    """Fly one flight to its end, and go on listening for what the vehicle does then; return what happened."""
    profile, vehicle = load_profile("flight"), load_vehicle("sihsim")
    settings = CompanionSettings(may_arm=may_arm, takeoff_height_m=3.0 if may_arm else None, limits=case.limits)
    track = load_track(TRACK, vehicle, profile).track
    companion = bench.companion = Companion(settings, profile, vehicle, track, perf_counter)
    give_up_us = bench.now_us + round(GIVE_UP_S * 1e6)
    flying_us = disturbed_us = limited_us = 0
    while companion.ended is None and bench.now_us < give_up_us:
        bench.turn()
        if companion.phase is CompanionPhase.CHECKING and not may_arm and companion.peer.report.mode != HOLD.custom:
            bench.order(mav.MAV_CMD_DO_SET_MODE, *HOLD.command)
        if companion.phase is CompanionPhase.FLYING and not flying_us:
            flying_us = bench.now_us
        if flying_us and not disturbed_us and bench.now_us - flying_us > FLIES_S * 1e6:
            disturbed_us = bench.now_us
            case.disturb(bench)
        if companion.limit is not None and not limited_us:
            limited_us = bench.now_us
    ended_us = bench.now_us
    stays_us = bench.now_us + 1_000_000
    while bench.now_us < stays_us:
        bench.turn()
    report = companion.peer.report
    return {
        "ended": companion.ended is not None and companion.ended.why,
        "in_order": companion.ended is not None and companion.ended.in_order,
        "limit": companion.limit.name if companion.limit else "",
        "mode": report.mode,
        "armed": report.armed,
        "sent_after_disturbed_s": (bench.sent_us - disturbed_us) * 1e-6 if disturbed_us else None,
        "limit_after_disturbed_s": (limited_us - disturbed_us) * 1e-6 if limited_us and disturbed_us else None,
        "ended_after_limit_s": (ended_us - limited_us) * 1e-6 if limited_us else None,
        "phases": companion.said,
    }


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
