"""Time from a command of PX4 or ArduPilot to the plant's next frame."""

from math import inf, sqrt
from struct import Struct
from time import perf_counter
from typing import Any, cast

from colibri.bench.speed import Report
from colibri.bench.stages import summary
from colibri.common.process.lifecycle import Stop
from colibri.common.process.status import Silent
from colibri.common.spec import from_values
from colibri.common.types import Address
from colibri.mavlink.links.link import Endpoint
from colibri.mavlink.links.udp import UdpLink
from colibri.mavlink.wire.dialect import Codec, mav
from colibri.plant.process import ardupilot_server, px4_server
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import load_vehicle
from colibri.plant.vehicle.parameter_files import px4_parameters

PX4, ARDUPILOT = "PX4", "ArduPilot"
VEHICLES = {PX4: "iris", ARDUPILOT: "hummingbird"}
FRAMES_HZ = {PX4: 250, ARDUPILOT: 1200}
AIR: dict[str, dict[str, str]] = {"calm": {}, "moderate turbulence": {"turbulence": "moderate", "wind": "5@270"}}
_HIGH_UP = {"z": 100.0}
"""A vehicle without control needs room to fall."""
_LOADED_AFTER = 100
_TRUTH_EVERY_US = 5e3
"""Interval that PX4 requests."""
_REQUEST, _MAGIC = Struct("<HHI16H"), 18458
_ELSEWHERE: Address = ("127.0.0.1", 1)


class _Never(Stop):
    """Is never set."""

    def __init__(self) -> None:
        self.code = 0

    def __bool__(self) -> bool:
        return False


class _Answers(Endpoint):
    """A link whose autopilot answers each frame at once."""

    def __init__(self, answers: list[bytes]) -> None:
        super().__init__("", None)
        self._answers = iter(answers)
        self._waiting = next(self._answers)
        self._answered_s = perf_counter()
        self.times_us: list[float] = []

    def send(self, _datagram: bytes, _address: Address | None = None) -> None:
        self.times_us.append((perf_counter() - self._answered_s) * 1e6)
        self._waiting = next(self._answers)

    def receive_now(self) -> list[tuple[bytes, Address]]:
        received, self._waiting = self._waiting, b""
        self._answered_s = perf_counter()
        return [(received, _ELSEWHERE)] if received else []

    def receive(self, _timeout_s: float) -> tuple[bytes, Address]:
        ((datagram, sender),) = self.receive_now()
        return datagram, sender

    def wait(self, timeout_s: float) -> None: ...

    def close(self) -> None: ...


def simulator_figures(duration_s: float, report: Report) -> dict[str, Any]:
    figures = {}
    for whom in VEHICLES:
        for air, options in AIR.items():
            report(f"{whom}, {air}")
            figures[f"{whom}, {air}"] = summary(_times_us(whom, options, duration_s)[_LOADED_AFTER:])
    return {"exchange_us": figures, "frames_hz": FRAMES_HZ}


def _times_us(whom: str, air: dict[str, str], duration_s: float) -> list[float]:
    frames = round(duration_s * FRAMES_HZ[whom]) + 2 * _LOADED_AFTER
    options = {
        "serve": "px4" if whom == PX4 else "ardupilot-json",
        "speed": inf,
        "duration": frames / FRAMES_HZ[whom],
        "vehicle": VEHICLES[whom],
        "start": _HIGH_UP,
    }
    spec = from_values(PlantSpec, options | air)
    link = _Answers((_of_px4 if whom == PX4 else _of_ardupilot)(frames + 2))
    if whom == PX4:
        px4_server.run(spec, link, Silent(), _Never())
    else:
        ardupilot_server.run(spec, cast(UdpLink, link), Silent(), _Never())
    return link.times_us


def _hover(whom: str) -> float:
    return sqrt(px4_parameters(load_vehicle(VEHICLES[whom]))["MPC_THR_HOVER"])


def _of_px4(count: int) -> list[bytes]:
    codec, interval_us = Codec(1, 1), 1_000_000 // FRAMES_HZ[PX4]
    wanted = (mav.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, _TRUTH_EVERY_US, 0, 0, 0, 0, 0)
    request = codec.encode("COMMAND_LONG", 0, 0, mav.MAV_CMD_SET_MESSAGE_INTERVAL, 0, *wanted)
    hello = request + codec.encode("HEARTBEAT", 0, mav.MAV_AUTOPILOT_PX4, 0, 0, 0, 3)
    mode = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mav.MAV_MODE_FLAG_SAFETY_ARMED
    controls = [_hover(PX4)] * 4 + [0.0] * 12
    times_us = (interval_us * frame for frame in range(1, count + 1))
    return [hello, *(codec.encode("HIL_ACTUATOR_CONTROLS", time_us, controls, mode, 1) for time_us in times_us)]


def _of_ardupilot(count: int) -> list[bytes]:
    pulses = [1000 + round(1000 * _hover(ARDUPILOT))] * 4 + [0] * 12
    return [_REQUEST.pack(_MAGIC, FRAMES_HZ[ARDUPILOT], number + 1, *pulses) for number in range(count)]
