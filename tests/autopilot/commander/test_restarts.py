"""Every flight task goes on after a restart: a checkpoint that is taken in its midst and resumed flies on the same."""

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
import pytest

import colibri.autopilot
from colibri.autopilot.commander.missions import MissionTask
from colibri.autopilot.commander.mode_tasks import TaskRecord, task_record
from colibri.autopilot.commander.pilot import PilotRecord
from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.guidance.mission.executor import MissionRecord
from colibri.autopilot.guidance.tasks.attitude import AltitudeTask, DescentTask, StabilizedTask
from colibri.autopilot.guidance.tasks.follow import FollowTargetTask
from colibri.autopilot.guidance.tasks.guided import GuidedSettings, GuidedTask
from colibri.autopilot.guidance.tasks.offboard import OffboardTask
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.orders import GoTo, Orbit
from colibri.autopilot.guidance.tasks.position import GoToTask, HoldTask, LandTask, TakeoffTask, TaskSequence, TrackTask
from colibri.autopilot.guidance.tasks.sticks import PositionTask
from colibri.autopilot.guidance.tasks.task import ClientInputs, FlightTask
from colibri.common.serialization import of_bytes, to_bytes
from colibri.common.types import Vector
from colibri.mavlink.mission.items import FENCE, MISSION, RALLY, plan_of
from colibri.mavlink.setpoints.setpoints import PositionSetpoint, Sticks, TargetState
from tests.support.cockpit import Cockpit, item

PLACE: Vector = (2.0, 0.0, 2.0)
MISSION_ITEMS = (
    item("NAV_WAYPOINT", place=(4.0, 0.0, 4.0)),
    item("NAV_LOITER_TURNS", 0.75, 0.0, 2.0, place=(4.0, 0.0, 4.0)),
    item("NAV_LAND", place=(8.0, 0.0, 0.0)),
)
PLANS = {MISSION: plan_of(MISSION_ITEMS), FENCE: plan_of(()), RALLY: plan_of(())}
STEERED = ClientInputs(
    Sticks(pitch=0.5, roll=-0.3, thrust=0.7, yaw=0.2),
    PositionSetpoint((20.0, 5.0, 8.0)),
    TargetState((15.0, 0.0, 0.0), (1.0, 0.5, 0.0), (0.0, 0.0, 0.0)),
)
NEAR = 0.02  # m, m/s, rad: a circle is joined again at the angle of the reference, which lags a little
DATA = TypeVar("DATA")


def go_far(cockpit: Cockpit) -> None:
    cockpit.pilot.fly(Mode.HOLD, GoToTask(GoTo((60.0, 10.0, 12.0)), cockpit.pilot.context()), {})


def brake(cockpit: Cockpit) -> None:
    go_far(cockpit)
    cockpit.fly_for(3.0)
    cockpit.pilot.select(Mode.HOLD, {})


def take_off(cockpit: Cockpit) -> None:
    cockpit.pilot.touch_down()
    cockpit.pilot.arm({}, force=True)
    cockpit.pilot.select(Mode.TAKEOFF, {})


def come_home(cockpit: Cockpit) -> None:
    go_far(cockpit)
    cockpit.fly_for(10.0)
    cockpit.pilot.select(Mode.RETURN, {})


def circle(cockpit: Cockpit) -> None:
    cockpit.pilot.fly(Mode.ORBIT, OrbitTask(Orbit((0.0, 0.0, 2.0), 2.0), cockpit.pilot.context()), {})


def guide(cockpit: Cockpit) -> None:
    task = cockpit.tasks.guided(lambda: GuidedSettings(3_000_000, looks_ahead=True, by_thrust=False, hover=0.4))
    cockpit.pilot.fly(Mode.HOLD, task, {})
    task.take(PositionSetpoint((20.0, 5.0, 8.0)), cockpit.pilot.context())


def begins(mode: Mode) -> Callable[[Cockpit], object]:
    return lambda cockpit: cockpit.pilot.select(mode, {})


MIDWAY: dict[type, tuple[Callable[[Cockpit], object], float]] = {
    AltitudeTask: (begins(Mode.ALTITUDE), 1.0),
    DescentTask: (lambda cockpit: cockpit.pilot.save(Action.DESCEND), 0.5),
    FollowTargetTask: (begins(Mode.FOLLOW), 2.0),
    GoToTask: (go_far, 3.0),
    GuidedTask: (guide, 2.0),
    HoldTask: (brake, 0.3),
    LandTask: (begins(Mode.LAND), 0.7),
    MissionTask: (begins(Mode.MISSION), 7.0),
    OffboardTask: (begins(Mode.OFFBOARD), 2.0),
    OrbitTask: (circle, 10.0),
    PositionTask: (begins(Mode.POSITION), 2.0),
    StabilizedTask: (begins(Mode.STABILIZED), 1.0),
    TakeoffTask: (take_off, 1.0),
    TaskSequence: (come_home, 3.0),
    TrackTask: (begins(Mode.TRACK), 6.0),
}
"""How each task begins, and the time to its midst, s."""


def task_classes() -> set[type]:
    """Return every class of the autopilot that is a flight task, found by its methods."""
    found = set()
    for module in pkgutil.walk_packages(colibri.autopilot.__path__, "colibri.autopilot."):
        for _, kind in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            if hasattr(kind, "update") and hasattr(kind, "arrived") and kind is not FlightTask:
                found.add(kind)
    return found


def flown(task: FlightTask) -> Iterator[FlightTask]:
    yield task
    if isinstance(task, TaskSequence) and task.task is not None:
        yield from flown(task.task)


def kept(kind: type[DATA], data: DATA) -> DATA:
    read = of_bytes(kind, to_bytes(data))
    assert read is not None
    return read


def restarted(before: Cockpit) -> Cockpit:
    after = Cockpit(PLACE)
    after.missions.resume(PLANS, kept(MissionRecord, before.missions.executor.record()))
    task = kept(TaskRecord, task_record(before.pilot.task))
    after.pilot.resume(
        before.now_us,
        before.state,
        kept(PilotRecord, before.pilot.record()),
        lambda mode, context: after.tasks.again(task, mode, context),
        seamless=True,
    )
    after.now_us, after.state, after.steered = before.now_us, before.state, before.steered
    return after


def test_every_flight_task_is_restarted_here() -> None:
    assert task_classes() == set(MIDWAY)


@pytest.mark.parametrize("kind", MIDWAY, ids=lambda kind: kind.__name__)
def test_a_task_that_is_resumed_in_its_midst_goes_on_the_same(kind: type) -> None:
    begin, midst_s = MIDWAY[kind]
    before = Cockpit(PLACE)
    before.missions.resume(PLANS, None)
    before.steered = STEERED
    before.step()
    begin(before)
    before.fly_for(midst_s)
    assert kind in map(type, flown(before.pilot.task)), before.pilot.task
    after = restarted(before)
    for _ in range(150):
        expected, guidance = before.step(), after.step()
        assert after.pilot.state == before.pilot.state
        np.testing.assert_allclose(after.state.position_enu_m, before.state.position_enu_m, atol=NEAR)
        np.testing.assert_allclose(after.state.velocity_enu_m_s, before.state.velocity_enu_m_s, atol=NEAR)
        np.testing.assert_allclose(after.state.euler, before.state.euler, atol=NEAR)
        assert (guidance.attitude is None) is (expected.attitude is None)
    if expected.attitude is not None and guidance.attitude is not None:
        for demanded, again in zip(expected.attitude, guidance.attitude, strict=True):
            np.testing.assert_allclose(again, demanded, atol=0.05)  # N: the integral of the height loop begins at 0
    assert before.pilot.state.armed
