"""The flights into which exceptions are thrown: a situation prepared, flown on, and judged."""

from collections.abc import Callable
from math import cos, hypot, radians
from typing import NamedTuple

from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import Mode
from colibri.common.rotations import tilt_deg
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.mission.items import MISSION, MissionItem
from colibri.mavlink.wire.dialect import mav
from colibri.plant.physics.world import state_frame
from tools.chaos.places import Thrower
from tools.harness.client import COMPONENT, SYSTEM
from tools.harness.copter_flight import CopterFlight

HEIGHT_M = 5.0
MAX_TILT_DEG = 75.0
MAX_IMPACT_M_S = 3.5
_WATCH_S, _LAND_WITHIN_S = 2.5, 30.0
_NEAR_GROUND_M = 0.15
_LOST_M = 60.0
_FRAME = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
_EAST_DEGE7_M = 1e7 / (111_320.0 * cos(radians(47.4)))


class Verdict(NamedTuple):
    """What became of a flight.

    Attributes:
        outcome: "flown on", "landed", "not reached", or what did not hold.
        thrown: How many exceptions were thrown.
        said: The first STATUSTEXT about it.
    """

    outcome: str
    thrown: int
    said: str

    @property
    def holds(self) -> bool:
        """Whether what must hold does."""
        return self.outcome in ("flown on", "landed", "not reached")


def airborne(feedback: Feedback) -> CopterFlight:
    """Return a vehicle that hovers."""
    flight = CopterFlight(feedback=feedback, strict=False)
    flight.takeoff(HEIGHT_M)
    return flight


def hover(flight: CopterFlight) -> None:
    """Hover."""


def track(flight: CopterFlight) -> None:
    """Fly the lemniscate."""
    flight.set_param("TRACK", 2)
    flight.select(Mode.TRACK)
    flight.run(4.0)


def offboard(flight: CopterFlight) -> None:
    """Fly by velocity setpoints."""
    flight.setpoint(velocity=(3.0, 1.0, 0.0))
    flight.select(Mode.OFFBOARD)


def mission(flight: CopterFlight) -> None:
    """Fly a mission."""
    there = flight.copter.pilot.home.origin
    east = round(20.0 * _EAST_DEGE7_M)
    items = [
        MissionItem(_FRAME, mav.MAV_CMD_NAV_WAYPOINT, 1, 0.0, 0.0, 0.0, 0.0,
                    round(there.latitude_deg * 1e7) + north, round(there.longitude_deg * 1e7) + x, 6.0)
        for north, x in ((900, east), (-900, -east), (900, east))
    ]  # fmt: skip
    flight.copter.stations.plans.load(MISSION, items)
    flight.select(Mode.MISSION)


def landing(flight: CopterFlight) -> None:
    """Land."""
    flight.select(Mode.LAND)
    flight.run(0.5)


SITUATIONS: dict[str, Callable[[CopterFlight], None]] = {
    each.__name__: each for each in (hover, track, offboard, mission, landing)
}


class Flown:
    """A flight with a thrower in it, watched."""

    def __init__(self, flight: CopterFlight, situation: str, thrower: Thrower) -> None:
        """Go on with a flight in a situation; the thrower is armed at once."""
        self._flight, self._situation, self._thrower = flight, situation, thrower
        self._frames = 0

    def judged(self) -> Verdict:
        """Fly on, and judge."""
        flight, copter = self._flight, self._flight.copter
        flight.client.forget()
        self._thrower.arm()
        try:
            outcome = self._flown()
        except Exception as error:
            outcome = f"raised {type(error).__name__}: {error}"
        finally:
            self._thrower.disarm()
        said = next((text for text in flight.client.texts if " failed: " in text), "")
        if self._thrower.thrown == 0:
            outcome = "not reached" if outcome in ("flown on", "landed") else outcome
        elif not copter.defence.counts or not copter.defence.take():
            outcome = "no record"
        elif not said:
            outcome += ", unsaid"
        return Verdict(outcome, self._thrower.thrown, said)

    def _flown(self) -> str:
        flight = self._flight
        begun_s = flight.time_s
        while flight.time_s < begun_s + _LAND_WITHIN_S:
            trouble = self._step()
            if trouble:
                return trouble
            if not flight.rotors.armed:
                return self._down()
            if flight.time_s > begun_s + _WATCH_S and not self._lands():
                return "flown on"
        return "never landed"

    def _step(self) -> str:
        """Fly a frame, with all that clients send; return what does not hold."""
        flight, n = self._flight, self._frames
        self._frames += 1
        if n % 100 == 0:
            flight.send("HEARTBEAT", mav.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
        if n % 25 == 1:
            flight.send("COMMAND_LONG", SYSTEM, COMPONENT, mav.MAV_CMD_REQUEST_MESSAGE, 0, 148.0, *(0.0,) * 6)
        if n == 3:
            flight.send("PARAM_SET", SYSTEM, COMPONENT, b"WHL_POLE1", -7.1, mav.MAV_PARAM_TYPE_REAL32)
        if n % 10 == 0 and self._situation == "offboard":
            flight.setpoint(velocity=(3.0, 1.0, 0.0))
        flight.step()
        flight.copter.record()
        frame = state_frame(flight.world)
        x, y, z = frame.position_enu_m
        if tilt_deg(frame.attitude) > MAX_TILT_DEG:
            return f"tilted {tilt_deg(frame.attitude):.0f} degrees at {z:.1f} m"
        if z < _NEAR_GROUND_M and hypot(*frame.velocity_enu_m_s) > MAX_IMPACT_M_S:
            return f"came down at {hypot(*frame.velocity_enu_m_s):.1f} m/s"
        return f"{hypot(x, y, z):.0f} m away" if hypot(x, y, z) > _LOST_M else ""

    def _lands(self) -> bool:
        pilot, actuation = self._flight.copter.pilot, self._flight.copter.parts.actuation
        lands = pilot.state.mode is Mode.LAND or pilot.saving in (Action.LAND, Action.DESCEND)
        return lands or actuation.descent is not None

    def _down(self) -> str:
        height_m = self._flight.position[2]
        return "landed" if height_m < _NEAR_GROUND_M else f"rotors stopped at {height_m:.1f} m"
