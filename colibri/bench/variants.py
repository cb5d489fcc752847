"""Variants of profile `flight`, and flights with them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from colibri.autopilot.control.profile import Profile
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.mavlink.hil.feedback import Feedback

CONTROLLER = "lpv-mpc"
TRACK = "lemniscate"


def with_blocks(profile: Profile, blocks: Sequence[int]) -> Profile:
    table = profile.table(CONTROLLER)
    return _with_table(profile, {**table, "plan": {**table["plan"], "blocks": list(blocks)}})


def with_intervals(profile: Profile, *, frame_s: float, control_s: float) -> Profile:
    simulation = msgspec.structs.replace(profile.simulation, frame_interval_s=frame_s)
    changed = _with_table(profile, {**profile.table(CONTROLLER), "control_interval_s": control_s})
    return msgspec.structs.replace(changed, simulation=simulation)


def plan_of(
    profile: Profile, folder: Path, duration_s: float, link: str, feedback: Feedback = Feedback.STATE
) -> FlightPlan:
    options = {"profile": profile, "link": link, "feedback": feedback, "duration": duration_s, "out": folder}
    return FlightPlan.of(FlightSpec.of(TRACK, **options))


def _with_table(profile: Profile, table: Mapping[str, Any]) -> Profile:
    return msgspec.structs.replace(profile, controllers={**profile.controllers, CONTROLLER: dict(table)})
