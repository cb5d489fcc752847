"""Costs of ground stations and of sensors."""

import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from math import inf, sqrt
from pathlib import Path
from struct import Struct
from time import perf_counter
from typing import Any, cast

from colibri.analysis.recording import read_recording
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.copter import copter_autopilot
from colibri.autopilot.estimation.estimator import Estimator
from colibri.autopilot.ground.stations import StationSettings
from colibri.bench.speed import TRACK, Report, plan_of, real_time_factor, sampled, summarised
from colibri.bench.stages import Figures, Stage, summary, timed
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.process.lifecycle import Stop, gc_frozen
from colibri.common.process.status import Silent
from colibri.common.spec import from_values
from colibri.common.types import Address
from colibri.flights.flight import SYSTEM_ID, direct_flight
from colibri.flights.fly import fly_plan, fly_processes
from colibri.flights.plan import FlightPlan
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.links.link import Endpoint
from colibri.mavlink.links.udp import UdpLink
from colibri.mavlink.streaming.rates import GCS, SDK
from colibri.mavlink.ulog.inputs import InputRecord, RecordKind
from colibri.mavlink.ulog.reader import FILE, FlightFile
from colibri.mavlink.wire.dialect import Codec, mav
from colibri.plant.physics.start import nudged
from colibri.plant.process import ardupilot_server, px4_server
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import load_vehicle
from colibri.plant.vehicle.parameter_files import px4_parameters

CHANNELS = (0, 1, 2, 4, 8)  # alternately a ground station's and an SDK's
KINDS = (GCS, SDK)
STATIONS = 2
ALONE, WATCHED = "alone", f"{STATIONS} stations"
_WATCHING = {ALONE: 0, WATCHED: STATIONS}

_MIN_FRAMES = 4  # frames until all code is loaded


def serving_figures(profile: Profile, folder: Path, duration_s: float, runs: int, report: Report) -> dict[str, Any]:
    plan = plan_of(profile, folder, duration_s, "udp")
    serve: dict[str, Figures] = {}
    for channels in CHANNELS:
        report(f"serving {channels} ground stations")
        serve[str(channels)] = served(plan, channels)
    measures = {name: partial(control_steps_us, plan, stations) for name, stations in _WATCHING.items()}
    steps = sampled(runs, lambda name: report(f"control steps, {name}"), measures)
    middle = {
        name: {key: sorted(figures[key] for figures in flown)[runs // 2] for key in flown[0]}
        for name, flown in steps.items()
    }
    return {"track": TRACK, "serve": serve, "control_step_us": middle}


def served(plan: FlightPlan, channels: int) -> Figures:
    """Fly in memory; return the time to serve the channels, with the log, after a frame, µs."""
    settings = StationSettings(system_id=1, identity="px4", origin=DEFAULT_ORIGIN)
    autopilot = copter_autopilot(plan.profile, plan.vehicle, settings, perf_counter, first=plan.track)
    stations = autopilot.stages.stations
    for link in range(channels):
        stations.streams.use(stations.hub.open(link, ("127.0.0.1", link)), KINDS[link % len(KINDS)])
    flight = direct_flight(autopilot, plan.spec, plan.plant_vehicle, plan.spec.feedback, nudged(plan.start))
    times_us: list[float] = []
    with gc_frozen(), timed(Stage("serve", Autopilot, "serve"), times_us):
        for _ in flight.samples(plan.spec.duration):
            pass
    sent = sum(channel.sent for channel in stations.hub.channels if channel.link >= 0)
    return {**summary(times_us[_MIN_FRAMES:]), "messages_hz": sent / plan.spec.duration}


def control_steps_us(plan: FlightPlan, stations: int) -> Figures:
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(stations)]
        for sock in sockets:  # takes datagrams, and ignores them
            sock.bind(("127.0.0.1", 0))
        links = tuple(f"udpout:127.0.0.1:{sock.getsockname()[1]}" for sock in sockets)
        watched = replace(plan, spec=replace(plan.spec, speed=1.0, gcs=links))
        fly_processes(watched)
        return summary(read_recording(watched).control_step_us[1:].tolist())


FRAME_US, CONTROL_US = 4_000, 8_000
LINKS = ("memory", "udp")
ALWAYS, IN_FLIGHT = "asked at every frame", "asked at every control sample"
_MIN_S = 4.0  # it begins with a second of standing
_SETTLED = 500  # frames left out: the estimator aligns


def sensing_figures(profile: Profile, folder: Path, duration_s: float, runs: int, report: Report) -> dict[str, Any]:
    duration_s = max(duration_s, _MIN_S)
    report("estimator")
    fly_plan(plan_of(profile, folder, duration_s, "memory", Feedback.SENSORS))
    frames = list(sensor_frames(FlightFile(folder / FILE).inputs()))
    steps = {
        ALWAYS: summary(_timed(profile, frames, lambda _time_us: True)),
        IN_FLIGHT: summary(_timed(profile, frames, lambda time_us: time_us % CONTROL_US == 0)),
    }
    plans = {
        f"{link}, {feedback}": plan_of(profile, folder, duration_s, link, feedback)
        for link in LINKS
        for feedback in Feedback
    }
    samples = sampled(runs, report, {name: partial(real_time_factor, plan) for name, plan in plans.items()})
    return {
        "track": TRACK,
        "estimator_us": steps,
        "real_time_factor": {name: summarised(values) for name, values in samples.items()},
    }


def sensor_frames(inputs: Iterable[InputRecord]) -> Iterator[SensorFrame]:
    end = AutopilotEnd(system_id=SYSTEM_ID, frame_interval_us=FRAME_US, now_s=0.0, feedback=Feedback.SENSORS)
    for _, kind, datagram in inputs:
        received = end.receive(datagram, 0.0) if kind == RecordKind.FRAME else None
        if received is not None and isinstance(received.frame, SensorFrame):
            yield received.frame


def _timed(profile: Profile, frames: list[SensorFrame], asked: Callable[[int], bool]) -> list[float]:
    vehicle = load_vehicle(profile.simulation.vehicle)
    assert vehicle.sensors is not None, "the profile's vehicle has sensors"
    estimator = Estimator(vehicle.sensors, vehicle.gravity_m_s2, DEFAULT_ORIGIN, FRAME_US)
    times_us = []
    for frame in frames:
        wanted = asked(frame.time_us)
        began_s = perf_counter()
        estimator.receive(frame)
        estimator.estimate() if wanted else estimator.advance()
        times_us.append((perf_counter() - began_s) * 1e6)
    return times_us[_SETTLED:]


PX4, ARDUPILOT = "PX4", "ArduPilot"
VEHICLES = {PX4: "iris", ARDUPILOT: "hummingbird"}
FRAMES_HZ = {PX4: 250, ARDUPILOT: 1200}
AIR: dict[str, dict[str, str]] = {"calm": {}, "moderate turbulence": {"turbulence": "moderate", "wind": "5@270"}}
_HIGH_UP = {"z": 100.0}  # a vehicle without control needs room to fall
_LOADED_AFTER = 100
_TRUTH_EVERY_US = 5e3  # interval that PX4 requests
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
        self.kept: Address | None = None

    def keep_to(self, peer: Address) -> None:
        self.kept = peer

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
