"""`python -m tools.chaos`: exceptions thrown into every place, at many instants of every situation, each in a fork."""

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from math import hypot, inf
from time import perf_counter
from typing import Any, NamedTuple

from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, mav
from colibri.sitl import mission_items as items
from colibri.sitl.backends.setting import setting_of
from colibri.sitl.session import Flights
from colibri.sitl.vehicle import Sitl

PACKAGE = "colibri."

PLACES: tuple[str, ...] = (
    "autopilot.estimation.state_source:StateSource.receive",
    "autopilot.estimation.estimator:Estimator._take_in",
    "autopilot.estimation.estimator:Estimator._publish",
    "autopilot.estimation.eskf:Filter.predict",
    "autopilot.estimation.eskf:Filter.fuse_fix",
    "autopilot.control.loop:ControlLoop.observe",
    "autopilot.core.supervision:Supervision.step",
    "autopilot.control.rotor_loss.rotor_loss:RotorLoss.look",
    "autopilot.control.rotor_loss.detector:RotorWatch.step",
    "autopilot.commander.needs:ModeNeeds.steered",
    "autopilot.commander.supervisor:Supervisor.position_known",
    "autopilot.commander.supervisor:Supervisor.step",
    "autopilot.commander.rules.failsafe_conditions:Conditions.look",
    "autopilot.commander.pilot:Pilot.sense",
    "autopilot.commander.pilot:Pilot.step",
    "autopilot.commander.pilot:Pilot.context",
    "autopilot.commander.pilot:Pilot.save",
    "autopilot.guidance.tasks.position:HoldTask.update",
    "autopilot.guidance.tasks.position:TaskSequence.update",
    "autopilot.guidance.tasks.position:TrackTask.update",
    "autopilot.guidance.tasks.position:LandTask.update",
    "autopilot.guidance.tasks.offboard:OffboardTask.update",
    "autopilot.commander.missions:MissionTask.update",
    "autopilot.guidance.mission.executor:MissionExecutor.step",
    "autopilot.commander.flight.reference_generator:ReferenceGenerator.lead",
    "autopilot.commander.flight.ground_contact:GroundContact.watch",
    "autopilot.core.actuation:Actuation.decide",
    "autopilot.control.loop:ControlLoop.decide",
    "autopilot.control.loop:ControlLoop._command",
    "autopilot.control.lpv_mpc.law:LpvMpc.step",
    "autopilot.control.lpv_mpc.law:LpvMpc._inputs",
    "autopilot.control.lpv_mpc.mpc:Mpc.plan",
    "autopilot.control.lpv_mpc.mpc:Mpc.solve",
    "autopilot.core.report:Reporter.report",
    "autopilot.ground.battery_monitor:BatteryMonitor.run",
    "autopilot.ground.snapshots:SnapshotBuilder.take",
    "autopilot.ground.forecast:Forecaster.forecast",
    "autopilot.ground.stations:Stations.update",
    "autopilot.ground.stations:Stations.receive_status",
    "autopilot.ground.stations:Stations._tell",
    "autopilot.ground.onboard_log:OnboardLog.update",
    "autopilot.ground.fault_injection:Failures.take",
    "mavlink.node.hub:Hub.receive",
    "mavlink.node.hub:Hub.poll",
    "mavlink.streaming.service:StreamService.poll",
    "mavlink.streaming.heartbeat:HeartbeatService.poll",
    "mavlink.streaming.heartbeat:HeartbeatService.receive",
    "mavlink.services.command:CommandService.receive",
    "mavlink.setpoints.arbitration:StreamedService.receive",
    "mavlink.parameters.service:ParameterService.receive",
    "autopilot.core.subscription:Subscribers.adopt",
    "autopilot.core.subscription:Subscribers._calls",
    "autopilot.core.checkpoint:Checkpointer.record",
)


class ChaosError(Exception):
    """Thrown on purpose."""


class Thrower:
    """Throws up to `times` exceptions in one place while armed."""

    def __init__(self, place: str, times: float = inf) -> None:
        module, _, dotted = place.partition(":")
        owner, _, self._name = dotted.partition(".")
        self._owner = getattr(import_module(PACKAGE + module), owner)
        self._method = vars(self._owner)[self._name]
        self._times = times
        self.thrown = 0

    def arm(self) -> None:
        def throwing(*args: Any, **options: Any) -> Any:
            if self.thrown >= self._times:
                return self._method(*args, **options)
            self.thrown += 1
            raise ChaosError(self._name)

        setattr(self._owner, self._name, throwing)

    def disarm(self) -> None:
        setattr(self._owner, self._name, self._method)


HEIGHT_M = 5.0
MAX_TILT_DEG = 75.0
MAX_IMPACT_M_S = 3.5
_WATCH_S, _LAND_WITHIN_S = 2.5, 30.0
_NEAR_GROUND_M = 0.15
_LOST_M = 60.0
_HOLDS = ("flown on", "landed", "not reached")


class ChaosOutcome(NamedTuple):
    outcome: str  # of `_HOLDS`, or the violated condition
    thrown: int  # number of exceptions
    said: str  # the first STATUSTEXT about them


@contextmanager
def airborne(feedback: Feedback) -> Iterator[Sitl]:
    with Flights(setting_of([{"feedback": feedback, "strict": False}]), None) as flights:
        flight = flights.begin()
        flight.takeoff(HEIGHT_M)
        yield flight


def hover(flight: Sitl) -> None: ...


def track(flight: Sitl) -> None:
    flight.set_param("TRACK", 2)
    flight.select(Mode.TRACK)
    flight.run(4.0)


def offboard(flight: Sitl) -> None:
    flight.setpoint(velocity=(3.0, 1.0, 0.0))
    flight.select(Mode.OFFBOARD)


def mission(flight: Sitl) -> None:
    there = ((20.0, 10.0), (-20.0, -10.0), (20.0, 10.0))
    flight.upload_mission(items.waypoint(east, north, 6.0) for east, north in there)
    flight.select(Mode.MISSION)


def landing(flight: Sitl) -> None:
    flight.select(Mode.LAND)
    flight.run(0.5)


SITUATIONS: dict[str, Callable[[Sitl], None]] = {
    each.__name__: each for each in (hover, track, offboard, mission, landing)
}


class ChaosFlight:
    def __init__(self, flight: Sitl, situation: str, thrower: Thrower) -> None:
        self._flight, self._situation, self._thrower = flight, situation, thrower
        self._frames = 0

    def judged(self) -> ChaosOutcome:
        flight, copter = self._flight, self._flight.inside.copter
        flight.gcs.forget()
        self._thrower.arm()
        try:
            outcome = self._flown()
        except Exception as error:
            outcome = f"raised {type(error).__name__}: {error}"
        finally:
            self._thrower.disarm()
        said = next((text for text in flight.gcs.texts if " failed: " in text), "")
        if self._thrower.thrown == 0:
            outcome = "not reached" if outcome in ("flown on", "landed") else outcome
        elif not copter.defence.counts:
            outcome = "no record"
        elif not said:
            outcome += ", unsaid"
        return ChaosOutcome(outcome, self._thrower.thrown, said)

    def _flown(self) -> str:
        flight = self._flight
        begun_s = flight.time_s
        while flight.time_s < begun_s + _LAND_WITHIN_S:
            trouble = self._step()
            if trouble:
                return trouble
            if not flight.rotors.armed:
                height_m = flight.position[2]
                return "landed" if height_m < _NEAR_GROUND_M else f"rotors stopped at {height_m:.1f} m"
            if flight.time_s > begun_s + _WATCH_S and not self._lands():
                return "flown on"
        return "never landed"

    def _step(self) -> str:
        """Return the violated condition, if any."""
        flight, n = self._flight, self._frames
        self._frames += 1
        if n % 25 == 1:
            flight.send(
                "COMMAND_LONG", flight.system, AUTOPILOT_COMPONENT, mav.MAV_CMD_REQUEST_MESSAGE, 0, 148.0, *(0.0,) * 6
            )
        if n == 3:
            flight.send("PARAM_SET", flight.system, AUTOPILOT_COMPONENT, b"LPV_POLE1", -7.1, mav.MAV_PARAM_TYPE_REAL32)
        if n % 10 == 0 and self._situation == "offboard":
            flight.setpoint(velocity=(3.0, 1.0, 0.0))
        flight.step()
        x, y, z = flight.position
        if flight.tilt_deg > MAX_TILT_DEG:
            return f"tilted {flight.tilt_deg:.0f} degrees at {z:.1f} m"
        if z < _NEAR_GROUND_M and flight.speed_m_s > MAX_IMPACT_M_S:
            return f"came down at {flight.speed_m_s:.1f} m/s"
        return f"{hypot(x, y, z):.0f} m away" if hypot(x, y, z) > _LOST_M else ""

    def _lands(self) -> bool:
        pilot, actuation = self._flight.inside.copter.pilot, self._flight.inside.copter.parts.actuation
        lands = pilot.state.mode is Mode.LAND or pilot.saving in (Action.LAND, Action.DESCEND)
        return lands or actuation.descent is not None


SPAN_S = 4.8  # over which the instants of a situation are spread
TIMES = (1.0, inf)  # exceptions from an instant on: one, or all


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.chaos", description=__doc__)
    parser.add_argument("--instants", type=int, default=20, help="of each situation (default %(default)s)")
    parser.add_argument("--place", action="append", default=[], metavar="NAME", help="only places that contain this")
    args = parser.parse_args()
    places = [place for place in PLACES if not args.place or any(name in place for name in args.place)]
    started_s, cases = perf_counter(), []
    for case in _side_by_side(places, args.instants):
        cases.append(case)
        if case["bad"]:
            print(f"FAILED: {case}", flush=True)
    outcomes = Counter(case["outcome"] for case in cases)
    print(", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common()))
    flown = len(cases) - outcomes["not reached"]
    failed = sum(case["bad"] for case in cases)
    print(f"{flown} flights with exceptions thrown, {failed} failed; {perf_counter() - started_s:.0f} s")
    return 1 if failed or not flown else 0


def _side_by_side(places: list[str], instants: int) -> Iterator[dict[str, Any]]:
    reading, writing = os.pipe()
    children = []
    for feedback in Feedback:
        pid = os.fork()
        if pid == 0:
            os.close(reading)
            with airborne(feedback) as flight:
                _fly_situations(flight, feedback, places, instants, writing)
            os._exit(0)
        children.append(pid)
    os.close(writing)
    with os.fdopen(reading, encoding="utf-8") as lines:
        for line in lines:
            yield json.loads(line)
    for pid in children:
        if os.waitpid(pid, 0)[1] != 0:
            raise RuntimeError("a process of the campaign has died")


def _fly_situations(flight: Sitl, feedback: Feedback, places: list[str], instants: int, out: int) -> None:
    for situation, prepare in SITUATIONS.items():
        pid = os.fork()
        if pid == 0:
            prepare(flight)
            for instant in range(instants):
                for place in places:
                    _fly(
                        flight, place, TIMES[instant % len(TIMES)], {"feedback": feedback, "situation": situation}, out
                    )
                steer = (lambda: flight.setpoint(velocity=(3.0, 1.0, 0.0))) if situation == "offboard" else None
                flight.run(SPAN_S / instants, steer)
                if not flight.armed:
                    break
            os._exit(0)
        _wait(pid)


def _wait(pid: int) -> None:
    if os.waitpid(pid, 0)[1] != 0:
        os._exit(1)


def _fly(flight: Sitl, place: str, times: float, case: dict[str, Any], out: int) -> None:
    pid = os.fork()
    if pid == 0:
        verdict = ChaosFlight(flight, case["situation"], Thrower(place, times)).judged()
        facts = {**case, "place": place, "goes_on": times > 1.0, "at_s": round(flight.time_s, 3), **verdict._asdict()}
        os.write(out, (json.dumps({**facts, "bad": verdict.outcome not in _HOLDS}) + "\n").encode())
        os._exit(0)
    _wait(pid)


if __name__ == "__main__":
    sys.exit(main())
