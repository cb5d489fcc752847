"""A vehicle and its clients in one process, without files, under fire from ground stations."""

import gc
import random
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from math import hypot
from statistics import median
from traceback import format_exc
from typing import Any, NamedTuple, TypeVar

import numpy as np
import psutil
from msgspec import structs

from colibri.autopilot.commander.rules.modes import MANUAL, Mode, State, custom_mode, mode_of_custom
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.copter import Copter, copter_autopilot
from colibri.autopilot.core.step import Received
from colibri.autopilot.ground.stations import StationSettings
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.types import Address, Vector
from colibri.flights.flight import Direct, SteppedFlight
from colibri.mavlink.files.tree import Files
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.mission.items import FENCE, MISSION, RALLY, MissionItem
from colibri.mavlink.services.command import NOT_GIVEN
from colibri.mavlink.wire.dialect import MARKER, mav
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import starting_world
from colibri.plant.simulation.plant import PlantBuilder
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import load_vehicle
from colibri.sitl.backends.link_faults import Trouble
from colibri.sitl.ground_station import Station
from colibri.sitl.stepping import Steered, Stepped
from colibri.sitl.vehicle import FORCE
from tools.fuzz.messages import COMMANDS, SENSIBLE, Messages, Sent, asked

SYSTEM, COMPONENT = 1, 1  # of the vehicle
_FIRST_PORT = 14550
StationT = TypeVar("StationT", bound=Station)
STANDING = Start()  # on its feet: z counts from where the vehicle stands
ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
_AS_IT_IS = load_profile("flight")
_PROFILE = structs.replace(_AS_IT_IS, simulation=structs.replace(_AS_IT_IS.simulation, frame_interval_s=None))
"""No frames between control samples: a third less to compute."""


class BareFlight(Stepped, Steered):
    """Plant and autopilot without the codec between them, and ground stations; nothing is recorded."""

    system = SYSTEM

    def __init__(self, files: Files | None = None) -> None:
        self._vehicle = load_vehicle(_PROFILE.simulation.vehicle)
        self._settings = StationSettings(system_id=SYSTEM, identity="px4", origin=DEFAULT_ORIGIN, files=files)
        self._stations: list[Station] = []
        autopilot = self._new_autopilot()
        builder = PlantBuilder(WorldSpec(), self._vehicle, {Feedback.STATE: STANDING}, origin=DEFAULT_ORIGIN)
        self.plant = builder.build(Feedback.STATE, autopilot.frame_interval_us)
        self._flight = SteppedFlight(self.plant, autopilot, Direct())
        self.rotors = ActuatorCommand(0, (0.0, 0.0, 0.0, 0.0), armed=False)
        self.client = self.add(Station, 255)
        self.step()
        self.step()

    @property
    def autopilot(self) -> Autopilot[Copter]:
        return self._flight.autopilot

    @property
    def copter(self) -> Copter:
        return self.autopilot.stages

    @property
    def time_us(self) -> int:
        return self.plant.world.time_us

    @property
    def position(self) -> Vector:
        x, y, z = self.plant.world.state[6:9]
        return (x, y, z)

    def add(self, kind: type[StationT], system: int) -> StationT:
        number = len(self._stations)
        station = kind(self, number, system=system, component=190, trouble=Trouble(), seed=0, beats=False)
        self._stations.append(station)
        self.copter.stations.hub.open(0, _address(station))
        return station

    def restart(self) -> None:
        self._flight = SteppedFlight(self.plant, self._new_autopilot(), Direct())
        for station in self._stations:
            self.copter.stations.hub.open(0, _address(station))

    def _new_autopilot(self) -> Autopilot[Copter]:
        return copter_autopilot(_PROFILE, self._vehicle, self._settings, lambda: 0.0, strict=True)

    def reset_world(self, start: Start) -> None:
        self.plant.world = starting_world(start, self._vehicle)._replace(time_us=self.time_us)

    def step(self) -> None:
        now_us = self.time_us
        sample = self._flight.step(
            Received(datagram, 0, _address(station))
            for station in self._stations
            for datagram in station.departing(now_us)
        )
        self.rotors = sample.command
        for station in self._stations:
            for outgoing in sample.to_stations:
                if outgoing.address == _address(station):
                    station.arriving(outgoing.datagram, now_us)
            station.listen(now_us)

    def send(self, name: str, *fields: Any) -> None:
        self.client.send(name, *fields)


def _address(station: Station) -> Address:
    return "127.0.0.1", _FIRST_PORT + station.number


HIGH = Start(z=15.0, vz=-1.0, rotors=4740.0)  # falling: a vehicle at rest has landed
_MAX_REFERENCE_M_S = 60.0
_MAX_DISTANCE_M, _MAX_HOME_DISTANCE_M = 2_000.0, 101_000.0
_ACK = mav.MAVLINK_MSG_ID_COMMAND_ACK
_PLACES = 3  # from which it is fired at
_FRAME = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
_WAYPOINT = MissionItem(_FRAME, mav.MAV_CMD_NAV_WAYPOINT, 1, 0.0, 0.0, 0.0, 0.0, 473977420, 85456100, 12.0)
_LOITER = _WAYPOINT._replace(command=mav.MAV_CMD_NAV_LOITER_TURNS, p1=1.0, p3=5.0)
PLAN = (_WAYPOINT, _LOITER, _WAYPOINT._replace(x=473978000, p1=3.0))

SITUATIONS: tuple[State, ...] = (
    *(State(mode, armed=True) for mode in Mode),
    State(Mode.HOLD, armed=False),
    State(Mode.MISSION, armed=False),
)
"""In the air in every mode, and disarmed on the ground."""


class BrokenError(AssertionError):
    """A condition is violated."""


class Shooter(Station):
    """A station that decodes acknowledgements only, for speed."""

    def arriving(self, datagram: bytes, now_us: int) -> None:
        at = 0
        while at < len(datagram):
            assert datagram[at] == MARKER, "the vehicle sends MAVLink 2 alone, but for what it forwards"
            end = at + 12 + datagram[at + 1] + (13 if datagram[at + 2] else 0)
            if int.from_bytes(datagram[at + 7 : at + 10], "little") == _ACK:
                super().arriving(datagram[at:end], now_us)
            at = end


class FuzzedVehicle:
    """One vehicle under fire from three places."""

    def __init__(self, chance: random.Random, files: Files | None = None) -> None:
        self.flight = BareFlight(files=files)
        self.messages = Messages(chance, [parameter.name for parameter in self.flight.copter.parameters], COMMANDS)
        self.sent: Counter[State] = Counter()
        self.accepted: Counter[int] = Counter()
        self._shooters = [self.flight.add(Shooter, 255) for _ in range(_PLACES)]
        self._unanswered: list[list[Sent]] = [[] for _ in range(_PLACES)]

    def shoot(self, sent: Sent, place: int) -> None:
        self._shooters[place].send_raw(sent.frame)
        self.sent[self.flight.copter.pilot.state] += 1
        if sent.wants_answer:
            self._unanswered[place].append(sent)

    def step(self) -> None:
        for client in (*self._shooters, self.flight.client):
            client.forget()
        self.flight.step()
        while self.flight.copter.stations.hub.waiting:  # beyond what is handled in a frame
            self.flight.step()
        for place, shooter in enumerate(self._shooters):
            commands, self._unanswered[place] = self._unanswered[place], []
            self._check_answers(commands, shooter.acks)
        _must(not self.flight.client.acks, "an acknowledgement went to a station without a request")
        check(self.flight)
        if self.flight.copter.stations.system.restart:
            self.flight.restart()

    def _check_answers(self, commands: list[Sent], acks: list[Any]) -> None:
        """Check that each command is acknowledged once, and accepted only if sensible."""
        requested = [(one.fields["command"], *one.source) for one in commands]
        answered = [(ack.command, ack.target_system, ack.target_component) for ack in acks]
        _must(requested == answered, f"requested {requested}, answered {answered}")
        for one, ack in zip(commands, acks, strict=True):
            if ack.result == ACCEPTED:
                self.accepted[ack.command] += 1
                sensible = SENSIBLE.get(ack.command)
                _must(sensible is None or sensible(asked(one.fields)), f"accepted {one}")

    def prepare(self, state: State) -> None:
        flight, copter = self.flight, self.flight.copter
        copter.parameters.reset()
        copter.parameters.propose("MIS_TAKEOFF_ALT", 40.0)  # after the reset, which is proposed, too
        for plan in (FENCE, RALLY, MISSION):
            copter.stations.plans.load(plan, ())
        self._order(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, FORCE)
        copter.parts.rotor_loss.forget()  # what has lost a rotor is not armed again, by force neither
        copter.pilot.readiness.rotor_failed = ""
        flight.reset_world(STANDING)
        flight.run(0.8)
        flight.send("SET_GPS_GLOBAL_ORIGIN", SYSTEM, *_integers(DEFAULT_ORIGIN))
        self._order(mav.MAV_CMD_DO_SET_HOME, 1.0)
        self._select(Mode.HOLD)
        if state.armed:
            flight.reset_world(HIGH)
            copter.pilot.ground.take_off(0)
            self._order(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, FORCE)
        copter.stations.plans.load(MISSION, PLAN)
        self._meet(state.mode)
        if state.mode is not Mode.ORBIT:
            self._select(state.mode)
        for _ in range(3):
            self.step()
        _must(copter.pilot.state == state, f"{copter.pilot.state} instead of {state}")

    def _meet(self, mode: Mode) -> None:
        if mode in MANUAL:
            self.flight.stick()
        elif mode is Mode.OFFBOARD:
            self.flight.setpoint(position=(0.0, 0.0, 15.0))
        elif mode is Mode.ORBIT:
            self.flight.send("COMMAND_INT", SYSTEM, COMPONENT, 3, mav.MAV_CMD_DO_ORBIT, 0, 0, 5.0, 2.0, 0.0, 0.0,
                             NOT_GIVEN, NOT_GIVEN, float("nan"))  # fmt: skip
            self.flight.run(0.1)
            self.flight.client.acks.clear()

    def _order(self, number: int, *params: float) -> None:
        result = self.flight.client.order(number, *params)
        _must(result == ACCEPTED, f"{number} {params}: {result}")
        self.flight.client.acks.clear()

    def _select(self, mode: Mode) -> None:
        number = custom_mode(mode)
        self._order(mav.MAV_CMD_DO_SET_MODE, 1.0, number >> 16 & 0xFF, number >> 24)

    @property
    def lost(self) -> bool:
        x, y, z = self.flight.position
        return hypot(x, y, z) > _MAX_DISTANCE_M or z < -1.0


def check(flight: BareFlight) -> None:
    pilot = flight.copter.pilot
    controls = flight.rotors.controls
    _must(all(0.0 <= control <= 1.0 for control in controls), f"rotors commanded to {controls}")
    _must(flight.rotors.armed or not any(controls), "a rotor turns while disarmed")
    _must(pilot.state.mode in Mode, "no mode of the table")
    modes = [mode_of_custom(beat.custom_mode) for beat in flight.client.heard["HEARTBEAT"]]
    _must(None not in modes, "no mode of the table is reported")
    reference = pilot.generator.reference
    _must(reference is not None, "there is always a reference")
    assert reference is not None
    _must(bool(np.isfinite(reference.motion).all() and np.isfinite(reference.heading).all()), "a reference of nan")
    fast = float(np.linalg.norm(reference.motion[1]))
    _must(fast < _MAX_REFERENCE_M_S, f"a reference of {fast:.0f} m/s")
    _must(hypot(*pilot.home.position_enu_m) <= _MAX_HOME_DISTANCE_M, "home is nowhere")


def _must(holds: bool, otherwise: str) -> None:
    if not holds:
        raise BrokenError(otherwise)


def _integers(place: tuple[float, float, float]) -> tuple[int, int, int]:
    latitude, longitude, altitude = place
    return round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3)


MAX_GROWTH_MIB = 4.0
FEWEST_FOR_MEMORY = 200_000  # with fewer, memory shows the allocator's habits
_A_FRAME = 40
_FRAMES_A_SITUATION = 15


class GroundOutcome(NamedTuple):
    sent: dict[State, int]
    accepted: int
    kinds: int  # of commands accepted
    flown_s: float
    memory_mib: tuple[float, float]  # after half of the messages and at the end
    failures: list[str]


def ground_campaign(quota: int, *, seed: int, files: Files | None = None) -> GroundOutcome:
    chance = random.Random(seed)
    target = FuzzedVehicle(chance, files)
    sent = 0
    memory_mib: list[float] = []
    failures: list[str] = []
    while sent < quota and not failures:
        for situation in SITUATIONS:
            try:
                sent += _fire(target, situation, chance, min(quota - sent, _A_FRAME * _FRAMES_A_SITUATION))
            except Exception as error:  # whatever the vehicle raises is what this looks for
                why = f" {error}" if isinstance(error, BrokenError) else f"\n{format_exc()}"
                failures.append(f"{situation}, message {target.sent.total()}:{why}")
                break
        if sent >= 0.5 * quota:
            memory_mib.append(_memory_mib())
    failures += [f"{state} never met a message" for state in SITUATIONS if not target.sent[state]]
    memory_mib = memory_mib or [_memory_mib()]
    failures += ["it grew"] * (quota >= FEWEST_FOR_MEMORY and growth_mib(memory_mib) > MAX_GROWTH_MIB)
    kinds, accepted = len(target.accepted), target.accepted.total()
    memory = (memory_mib[0], memory_mib[-1])
    return GroundOutcome(dict(target.sent), accepted, kinds, target.flight.time_s, memory, failures)


def growth_mib(samples: Sequence[float]) -> float:
    """Return the growth by a leak: one step of the allocator does not count."""
    sixths = [samples[i * len(samples) // 6 : (i + 1) * len(samples) // 6] for i in range(6)]
    if not all(sixths):
        return 0.0
    return 5.0 * median(median(b) - median(a) for a, b in pairwise(sixths))


def _fire(target: FuzzedVehicle, situation: State, chance: random.Random, quota: int) -> int:
    target.prepare(situation)
    sent = 0
    while sent < quota and not target.lost:
        for _ in range(min(_A_FRAME, quota - sent)):
            target.shoot(target.messages.any(), chance.randrange(_PLACES))
            sent += 1
        target.step()
    return sent


def _memory_mib() -> float:
    gc.collect()
    return float(psutil.Process().memory_info().rss / 2**20)
