"""The table of modes and what each begins with, and which of their needs are met."""

from typing import Any

import pytest

from colibri.autopilot.commander.missions import MissionTask
from colibri.autopilot.commander.needs import ModeNeeds
from colibri.autopilot.commander.rules.modes import Mode, Need
from colibri.autopilot.guidance.tasks.attitude import AltitudeTask, DescentTask, StabilizedTask
from colibri.autopilot.guidance.tasks.follow import FollowTargetTask
from colibri.autopilot.guidance.tasks.offboard import OffboardTask
from colibri.autopilot.guidance.tasks.position import HoldTask, TakeoffTask, TaskSequence, TrackTask
from colibri.autopilot.guidance.tasks.sticks import PositionTask
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.mavlink.mission.items import FENCE, MISSION
from colibri.mavlink.node.service import Peer
from colibri.mavlink.setpoints.setpoints import Sticks
from tests.support.cockpit import FLYING, Cockpit, item

BEGINS = {
    Mode.STABILIZED: StabilizedTask,
    Mode.ALTITUDE: AltitudeTask,
    Mode.POSITION: PositionTask,
    Mode.HOLD: HoldTask,
    Mode.TAKEOFF: TakeoffTask,
    Mode.LAND: TaskSequence,
    Mode.RETURN: TaskSequence,
    Mode.MISSION: MissionTask,
    Mode.OFFBOARD: OffboardTask,
    Mode.ORBIT: HoldTask,
    Mode.FOLLOW: FollowTargetTask,
    Mode.TRACK: TaskSequence,
}


@pytest.mark.parametrize("mode", Mode)
def test_every_mode_begins_with_its_course(mode: Mode) -> None:
    cockpit = Cockpit(FLYING)
    assert type(cockpit.tasks.begin(mode, cockpit.pilot.context())) is BEGINS[mode]


@pytest.mark.parametrize("mode", [Mode.STABILIZED, Mode.ALTITUDE])
def test_a_law_that_takes_no_attitude_stops_instead(mode: Mode) -> None:
    cockpit = Cockpit(FLYING, takes_attitude=False)
    assert isinstance(cockpit.tasks.begin(mode, cockpit.pilot.context()), HoldTask)


@pytest.mark.parametrize("takes_attitude", [False, True])
def test_a_landing_without_position_is_level_if_the_law_can(takes_attitude: bool) -> None:
    cockpit = Cockpit(FLYING, takes_attitude=takes_attitude)
    cockpit.step(position_known=False)
    assert cockpit.pilot.context().blind
    assert isinstance(
        cockpit.tasks.begin(Mode.LAND, cockpit.pilot.context()), DescentTask if takes_attitude else TaskSequence
    )


def test_a_track_from_time_0_is_flown_once() -> None:
    cockpit = Cockpit((0.0, 0.0, 0.0), first=track("spiral"), mode=Mode.TRACK)
    task = cockpit.pilot.task
    assert isinstance(task, TrackTask)
    assert task.start is not None
    assert cockpit.pilot.generator.reference is task.start
    assert cockpit.tasks.first is None
    assert isinstance(cockpit.tasks.begin(Mode.TRACK, cockpit.pilot.context()), TaskSequence)


class Nobody:
    held: tuple[int, ...] = ()

    def __init__(self, refusal: str = "") -> None:
        self._refusal = refusal

    def latest(self, now_us: int, timeout_us: int) -> None:
        """Return nothing."""

    def refusal(self, _now_us: int) -> str:
        return self._refusal

    def engage(self, peer: Peer, now_us: int) -> None:
        """Take no note of who steers."""


class Somebody(Nobody):
    def __init__(self, time_us: int) -> None:
        super().__init__()
        self.sticks = Sticks(0.0, 0.0, 0.5, 0.0, time_us)

    def latest(self, now_us: int, timeout_us: int) -> Sticks | None:  # type: ignore[override]
        return self.sticks if now_us - self.sticks.time_us <= timeout_us else None


def needs_of(
    cockpit: Cockpit, manual: Nobody | None = None, offboard: Nobody | None = None, follow: Nobody | None = None
) -> ModeNeeds:
    services: tuple[Any, ...] = tuple(each or Nobody() for each in (manual, offboard, follow))
    return ModeNeeds(cockpit.pilot, cockpit.missions, *services, takes_attitude=True)


def test_most_needs_are_missing_at_first() -> None:
    cockpit = Cockpit()
    missing = needs_of(cockpit).missing()
    assert set(missing) == {Need.STICKS, Need.SETPOINTS, Need.MISSION, Need.CIRCLE, Need.FLYING}


def test_needs_name_what_is_received_and_refused() -> None:
    needs = needs_of(Cockpit(), Nobody("roll 2"), Nobody("frame 99"), Nobody("no position"))
    missing = needs.missing()
    assert (missing[Need.STICKS], missing[Need.SETPOINTS]) == ("roll 2", "frame 99")
    assert (needs.remark(Mode.FOLLOW), needs.remark(Mode.HOLD)) == ("no position", "")
    assert "FOLLOW_TARGET" in needs_of(Cockpit()).remark(Mode.FOLLOW)


def test_needs_are_met_one_by_one() -> None:
    cockpit = Cockpit(FLYING)
    needs = needs_of(cockpit, manual=Somebody(1_000_000))
    needs.at(1_000_000)
    assert Need.STICKS not in needs.missing()
    assert Need.FLYING not in needs.missing()
    needs.at(2_000_000)
    assert Need.STICKS in needs.missing()
    assert needs.steered(1_100_000).sticks is not None
    cockpit.load(MISSION, item("NAV_WAYPOINT", place=(20.0, 0.0, 10.0)))
    assert Need.MISSION not in needs.missing()
    cockpit.load(FENCE, item("NAV_FENCE_CIRCLE_INCLUSION", 8.0, place=(0.0, 0.0, 0.0)))
    assert Need.INSIDE_FENCE in needs.missing()
    cockpit.step(position_known=False)
    assert Need.POSITION in needs.missing()
