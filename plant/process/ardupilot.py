"""The plant's end of ArduPilot's JSON interface, as a state machine: (datagram, sender, wall-clock time) -> reply.

ArduPilot sends one binary datagram per step, and repeats it after about a second without a reply. Source: ArduPilot,
libraries/SITL/examples/JSON/readme.md and SIM_JSON.cpp.

- Each request advances the world by 1/frame_rate; remainders in µs are carried over, so that time does not drift.
- A repeated frame_count gets the stored reply; a smaller one means a restart: the world begins again at time 0.
- A pulse of 1000 to 2000 µs is a rotor's speed, zero to top, or its thrust, as the vehicle file defines.
"""

from collections import Counter
from collections.abc import Callable
from struct import Struct

import msgspec

from colibri.common.types import Address
from colibri.mavlink.hil.lockstep import is_another
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu
from colibri.plant.physics.world import Physics, World, state_frame
from colibri.plant.vehicle.description import Rotors
from colibri.plant.vehicle.rotor_numbering import Numbering

_MAGIC = {Struct("<HHI16H"): 18458, Struct("<HHI32H"): 29569}
_FORMATS = {form.size: form for form in _MAGIC}
_FIRST_ROTOR = 3
_MIN_PULSE_US, _PULSE_RANGE_US = 1000.0, 1000.0
_SECOND_US = 1_000_000
_MIN_RATE_HZ = 10


class ArduPilotEnd:
    """Steps a world at each request; `is_there` tells whether a program has the address of a silent peer."""

    def __init__(
        self,
        physics: Physics,
        start: World,
        motors: Numbering,
        rotors: Rotors,
        is_there: Callable[[Address], bool] = lambda _: False,
    ) -> None:
        self._physics, self._motors, self._rotors, self._is_there = physics, motors, rotors, is_there
        self._start = self.world = start
        self.peer: Address | None = None
        self.steps = self.restarts = 0
        self.dropped: Counter[str] = Counter()
        self._received_s = 0.0
        self._count: int | None = None
        self._carried = 0
        self._reply = b""

    def receive(self, datagram: bytes, sender: Address, now_s: float) -> bytes | None:
        form = _FORMATS.get(len(datagram))
        fields = form.unpack(datagram) if form else ()
        if form is None or fields[0] != _MAGIC[form]:
            self.dropped["malformed"] += 1
            return None
        _, rate_hz, count = fields[:3]
        if rate_hz < _MIN_RATE_HZ:
            self.dropped["frame rate"] += 1
            return None
        if is_another(sender, self.peer, now_s - self._received_s, self._is_there):
            self.dropped["second autopilot"] += 1
            return None
        self.peer, self._received_s = sender, now_s
        if count == self._count:
            self.dropped["repeated"] += 1
            return self._reply
        if self._count is not None and count < self._count:
            self.world, self._carried = self._start, 0
            self.restarts += 1
        self._count = count
        self._advance(rate_hz, fields[_FIRST_ROTOR : _FIRST_ROTOR + self._rotors.count])
        self._reply = _encode(self.world, self._physics)
        return self._reply

    def _advance(self, rate_hz: int, pulses_us: tuple[int, ...]) -> None:
        duration_us, self._carried = divmod(_SECOND_US + self._carried, rate_hz)
        controls = tuple(map(_control, pulses_us))
        turning = any(controls)  # disarmed, ArduPilot sends the least pulse or none
        speeds = self._rotors.speeds_of(self._motors.to_vehicle(controls))
        command = ActuatorCommand(self.world.time_us, speeds, turning)
        self.world = self._physics.step(self.world, command, duration_us)
        self.steps += 1


def _control(pulse_us: int) -> float:
    return min(max((pulse_us - _MIN_PULSE_US) / _PULSE_RANGE_US, 0.0), 1.0)


def _encode(world: World, physics: Physics) -> bytes:
    frame = state_frame(world)
    values = {
        "timestamp": world.time_us / _SECOND_US,
        "imu": {"gyro": frd_from_flu(frame.rate_flu_rad_s), "accel_body": frd_from_flu(physics.specific_force(world))},
        "position": ned_from_enu(frame.position_enu_m),
        "quaternion": ned_frd_from_enu_flu(frame.attitude),
        "velocity": ned_from_enu(frame.velocity_enu_m_s),
    }
    return b"\n" + msgspec.json.encode(values) + b"\n"
