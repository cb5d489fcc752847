"""A stand-in for PX4 at a simulator: it sets its clock by HIL_SENSOR, and hovers on the truth that it has asked for."""

from collections.abc import Callable
from math import inf
from time import monotonic

import numpy as np

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, enu_of
from colibri.mavlink.links.link import GroundLink, receive_soon
from colibri.mavlink.wire.dialect import Codec, Message, mav
from tests.support.strangers import Airframe, Known, Point, hovering
from tools.harness.processes import GIVE_UP_AFTER_S

STARTING_FRAMES = 5  # how many frames PX4 needs before it moves a motor
TURN_M = 0.05 / 4.0
JMAVSIM = Airframe(
    0.8,
    (0.005, 0.005, 0.009),
    (
        (0.11667, 0.11667, TURN_M),
        (-0.11667, -0.11667, TURN_M),
        (0.11667, -0.11667, -TURN_M),
        (-0.11667, 0.11667, -TURN_M),
    ),
)
THRUST_N = 4.0


class Px4:
    """PX4's end of the conversation, without input or output."""

    def __init__(self, *, lockstep: bool = True, starting_frames: int = STARTING_FRAMES) -> None:
        self._codec = Codec(1, mav.MAV_COMP_ID_AUTOPILOT1)
        self._flags = 1 if lockstep else 0
        self._starting = starting_frames
        self.time_us = 0
        self.sensors = 0
        self.messages: list[Message] = []
        self.fixes: list[Message] = []
        self.known: Known | None = None
        self.armed = False
        self.target_ned_m: Point = (0.0, 0.0, 0.0)
        self.origin: Geodetic = DEFAULT_ORIGIN

    def hello(self) -> list[bytes]:
        interval = self._codec.encode(
            "COMMAND_LONG", 0, 0, mav.MAV_CMD_SET_MESSAGE_INTERVAL, 0, mav.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, 5e3,
            *[0.0] * 5,
        )  # fmt: skip
        return [interval, self._codec.encode("HEARTBEAT", 0, mav.MAV_AUTOPILOT_PX4, 0, 0, 0, 3)]

    def hear(self, datagram: bytes) -> list[bytes]:
        answers = []
        for message in self._codec.decode(datagram):
            fields = message.fields
            self.messages.append(message)
            if message.name == "HIL_GPS":
                self.fixes.append(message)
            elif message.name == "HIL_STATE_QUATERNION":
                place = Geodetic(fields.lat / 1e7, fields.lon / 1e7, fields.alt / 1e3)
                east, north, up = enu_of(place, self.origin)
                velocity = np.array((fields.vx, fields.vy, fields.vz)) / 100.0
                rate = np.array((fields.rollspeed, fields.pitchspeed, fields.yawspeed))
                self.known = Known(np.array((north, east, -up)), velocity, np.array(fields.attitude_quaternion), rate)
            elif message.name == "HIL_SENSOR":
                assert fields.time_usec >= self.time_us, "its clock cannot go back"
                self.sensors += fields.time_usec > self.time_us
                self.time_us = fields.time_usec
                if self.sensors > self._starting:
                    answers.append(self.answer())
        return answers

    def answer(self, control: float = inf) -> bytes:
        """Return what the motors shall do: hover, or the same control for all."""
        controls = [0.0] * 16
        if self.armed and self.known is not None:
            thrusts = hovering(JMAVSIM, self.known, self.target_ned_m).tolist()
            controls[:4] = [min(1.0, thrust / THRUST_N) if control == inf else control for thrust in thrusts]
        mode = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mav.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0)
        return self._codec.encode("HIL_ACTUATOR_CONTROLS", self.time_us, controls, mode, self._flags)


def serve(px4: Px4, link: GroundLink, until: Callable[[], bool], what: str) -> None:
    give_up_s = monotonic() + GIVE_UP_AFTER_S
    while not until():
        assert monotonic() < give_up_s, f"waited in vain for {what}"
        for datagram, sender in receive_soon(link, 0.1):
            for answer in px4.hear(datagram):
                link.send(answer, sender)
