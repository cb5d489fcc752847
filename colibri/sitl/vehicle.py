"""Fixture `sitl`: a vehicle in flight."""

from argparse import ArgumentTypeError
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from math import dist, nan, pi
from typing import TYPE_CHECKING, Any, NamedTuple

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.identities import conventions_of
from colibri.autopilot.parameters.behaviour import TRACKS
from colibri.autopilot.process.station_events import StationEvents
from colibri.common.earth.geodesy import Geodetic, geodetic_of
from colibri.common.errors import unknown
from colibri.mavlink.hil import faults
from colibri.mavlink.hil.conductor import Parcel
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.world_changes import MAX_PAYLOAD_KG, PayloadChange, WindChange
from colibri.mavlink.mission.items import FENCE, MISSION, RALLY, MissionItem, behind
from colibri.mavlink.parameters.store import Value
from colibri.mavlink.wire.dialect import Refusal, mav
from colibri.plant.texts import constant_wind
from colibri.sitl import mission_items as items
from colibri.sitl.backends.link_faults import Trouble
from colibri.sitl.backends.lockstep_session import Inside, LockstepSession
from colibri.sitl.backends.setting import Setting
from colibri.sitl.flight_record import Record, StatusTexts
from colibri.sitl.ground_station import RefusedError, Station
from colibri.sitl.mission_items import Item, on_wire
from colibri.sitl.stepping import NotInTimeError, Steered, Stepped
from colibri.sitl.view import View

__tracebackhide__ = True  # a failed test shows its own lines, not these

FORCE = 21196.0  # parameter of arming and disarming that overrides all checks
READY_WITHIN_S = 40.0
CALM = "0@0"
STICKS_EVERY_US = 40_000  # 25 Hz, as QGroundControl sends a joystick's
_SETTABLE = ("payload_kg", "wind")  # attributes that tests may assign
_FIRST_STICKS_S = 0.2  # time to get first sticks through a faulty link


class Links(NamedTuple):
    ground: Trouble  # between the vehicle and all ground stations, in simulated time
    plant: Trouble  # between plant and autopilot; the flight stays the same, as frames are repeated

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(unknown("link", name, self._fields))


class Sitl(View, Stepped, Steered):
    """A vehicle, its plant, its ground stations, and the links between them.

    Refused commands, uploads and parameters raise a `RefusedError`.

    Attributes:
        items: Functions for items of missions and fences, such as `items.waypoint(3.0, 0.0, 5.0)`.
        Refused: The error if the vehicle refuses.
        NotInTime: The AssertionError if a condition is not met in time.
        gcs: The first ground station, which sends commands.
        link: Link faults, which may be changed at any time.
        fleet: The vehicles in the same simulated time; empty if it flies alone.
    """

    items = items
    Refused = RefusedError
    NotInTime = NotInTimeError

    def __init__(self, setting: Setting, lockstep: LockstepSession, origin: Geodetic) -> None:
        self.setting = setting
        self._conventions = conventions_of(setting.identity)
        self.origin = origin
        self.link = Links(Trouble(**dict[str, Any](setting.ground)), lockstep.trouble)
        self.record = Record()
        self._lockstep = lockstep
        self._injected = b""
        self._wind, self._payload_kg = str(setting.wind or CALM), 0.0
        self._sticks: dict[str, float] | None = None
        self._sticks_at_us = 0
        self._events = StationEvents(setting.events, setting.system)
        self._stations: list[Station] = []
        self.gcs = self.client(255, 190)
        self._texts = StatusTexts()
        self.fleet: Sequence[Sitl] = ()

    if not TYPE_CHECKING:  # checkers know what there is

        def __setattr__(self, name: str, value: Any) -> None:
            if name[0] != "_" and "fleet" in self.__dict__ and not hasattr(self, name):
                raise AttributeError(unknown("attribute to set", name, _SETTABLE))
            super().__setattr__(name, value)

    def begin(self) -> None:
        if self.setting.ready:
            self.wait_until(lambda: self.gcs.heard["HEARTBEAT"], within=READY_WITHIN_S, what="the vehicle's HEARTBEAT")

    # Time.

    def step(self) -> None:
        """Fly one frame, with all vehicles of the fleet."""
        self.fly_frame()
        self.have_others_catch_up()

    def have_others_catch_up(self) -> None:
        for other in self.fleet:
            while other.time_us < self.time_us:
                other.fly_frame()

    def fly_frame(self) -> None:
        now_us = self.time_us
        if self._sticks is not None and now_us >= self._sticks_at_us:
            self._send_sticks()
        if now_us >= self._events.next_us:
            for encoded in self._events.due(now_us):
                self._send(encoded)
        stations, note = self._stations, self.record.note
        parcels = [Parcel(station.number, datagram) for station in stations for datagram in station.departing(now_us)]
        for _, datagram in parcels:
            note(now_us, datagram)
        instant = self._lockstep.advance(parcels, self._injected)
        if self._injected:
            self._injected = b""
        self.record.add(instant)
        for number, datagram in instant.to_stations.parcels:
            note(now_us, datagram)
            if number == self.gcs.number:
                self._texts.add_datagram(datagram, now_us)
            stations[number - 1].arriving(datagram, now_us)
        now_us = self.time_us
        for station in stations:
            station.listen(now_us)

    # Commands.

    def arm(self, *, force: bool = False) -> None:
        """Arm."""
        self.gcs.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, FORCE if force else 0.0, what="arming")

    def disarm(self, *, force: bool = False) -> None:
        """Disarm; in the air this requires `force`."""
        self.gcs.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, FORCE if force else 0.0, what="disarming")

    def takeoff(self, height_m: float | None = None, *, wait: bool = True, within: float | None = None) -> None:
        """Arm and climb to a height above home, default MIS_TAKEOFF_ALT; `within` defaults to 8 s and 2 s per metre."""
        height_m = self.get_param("MIS_TAKEOFF_ALT") if height_m is None else height_m
        east, north, from_m = self.position
        if self.home is not None and (self.armed or abs(self.home[2] - from_m) > self.near_m):
            from_m = self.home[2]  # home is where it is armed, unless it was set elsewhere
        first = self._conventions.modes.takeoff
        if first is not None:
            self._select(first, "the mode of take-off")
            self.arm()
        self.gcs.command(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, height_m, what="take-off")
        if not self.armed:
            self.arm()
        if wait:
            high_m, max_s = from_m + height_m, 8.0 + 2.0 * height_m if within is None else within
            up = lambda: self.mode is Mode.HOLD and self.is_at((east, north, high_m))  # noqa: E731
            self.wait_until(up, within=max_s, what="the climb")

    def land(self, *, wait: bool = True, within: float | None = None) -> None:
        """Land here and wait until disarmed; `within` defaults to 8 s and 2 s per metre."""
        max_s = 8.0 + 2.0 * self.position[2] if within is None else within
        self.select(Mode.LAND)
        if wait:
            self.wait_until(lambda: not self.armed, within=max_s, what="landing")

    def goto(
        self,
        east: float,
        north: float,
        up: float,
        *,
        yaw: float = nan,
        speed: float = -1.0,
        wait: bool = True,
        within: float | None = None,
    ) -> None:
        """Fly to a place, ENU, m, by a reposition command, and wait until `is_at` holds.

        Args:
            yaw: Counter-clockwise from east, rad; nan keeps it.
            speed: m/s; -1 for the default of the parameters.
            within: Simulated time, s; default 10 s and 1 s per metre.
        """
        there = geodetic_of((east, north, up), self.origin)
        x, y = round(there.latitude_deg * 1e7), round(there.longitude_deg * 1e7)
        heading = yaw if yaw != yaw else 0.5 * pi - yaw
        said = len(self.gcs.texts)
        params, place = (speed, 1.0, 0.0, heading), {"x": x, "y": y}
        frame, z = mav.MAV_FRAME_GLOBAL, there.altitude_m
        result = self.gcs.order_int(mav.MAV_CMD_DO_REPOSITION, *params, frame=frame, **place, z=z)
        self.gcs.check(result, said, "going there")
        if wait:
            goal = (east, north, up)
            max_s = 10.0 + dist(goal, self.position) if within is None else within
            self.wait_until(lambda: self.is_at(goal), within=max_s, what=f"the way to {goal}")

    def fly_track(self, name: str) -> None:
        """Fly a track of parameter TRACK; arm if disarmed, and go to its start first."""
        self.set_param("TRACK", TRACKS.index(_chosen("track", name, TRACKS)))
        self.select(Mode.TRACK)
        if not self.armed:
            self.arm()

    def select(self, mode: Mode | str) -> None:
        """Change the flight mode, by its name here or with the identity, such as "GUIDED"."""
        book = self._conventions.modes
        shown = {each.name: each.number for each in book.modes}
        number = shown.get(mode)
        if number is None:
            number = book.chosen[Mode(_chosen("mode", mode, (*Mode, *shown)))]
        self._select(number, mode)

    def _select(self, number: int, name: str) -> None:
        params = self._conventions.modes.as_command(number)
        self.gcs.command(mav.MAV_CMD_DO_SET_MODE, *params, what=f"mode {name}")

    def command(self, number: int, *params: float) -> int:
        """Send a COMMAND_LONG and return any MAV_RESULT; missing parameters are 0."""
        return self.gcs.order(number, *params)

    def start_mission(self) -> None:
        """Begin or resume the mission; arm if disarmed."""
        self.select(Mode.MISSION)
        if not self.armed:
            self.arm()
        book = self._conventions.modes
        if book.numbers[book.chosen[Mode.MISSION]].waits and self.mode is not Mode.MISSION:
            self.gcs.command(mav.MAV_CMD_MISSION_START, what="the mission")

    def upload_mission(self, plan: Iterable[Item | MissionItem]) -> None:
        """Upload a mission; where item 0 is home, it is put before the plan."""
        wire = on_wire(plan, self.origin)
        if self._conventions.wire.home_first:
            wire = [*on_wire([items.waypoint(0.0, 0.0, 0.0)], self.origin), *(behind(item, 1) for item in wire)]
        self.gcs.upload(wire, MISSION)

    def upload_fence(self, plan: Iterable[Item | MissionItem]) -> None:
        """Upload a geofence of `items.polygon` and `items.circle`."""
        self.gcs.upload(on_wire(plan, self.origin), FENCE, what="fence")

    def upload_rally(self, plan: Iterable[Item | MissionItem]) -> None:
        """Upload rally points."""
        self.gcs.upload(on_wire(plan, self.origin), RALLY, what="rally points")

    def get_param(self, name: str) -> Value:
        """Request a parameter."""
        return self.gcs.get_param(name)

    def set_param(self, name: str, value: Value) -> Value:
        """Set a parameter; return its new value, which has 32 bits."""
        return self.gcs.set_param(name, value)

    @contextmanager
    def sticks_held(self, **axes: float) -> Iterator[None]:
        """Hold the sticks, see `stick`, during the block; they are sent at 25 Hz."""
        before, self._sticks = self._sticks, axes
        self._send_sticks()  # now, so that they are heard before whatever else is sent
        if before is None and self.link.ground.any:
            self.run(_FIRST_STICKS_S + self.link.ground.delay_s + self.link.ground.jitter_s)
        try:
            yield
        finally:
            self._sticks = before

    def _send_sticks(self) -> None:
        self._sticks_at_us = self.time_us + STICKS_EVERY_US
        self.stick(**(self._sticks or {}))

    # Messages that are not answered.

    def send(self, name: str, *fields: Any) -> None:
        self.gcs.send(name, *fields)

    # What goes wrong.

    def inject(self, unit: str | int, kind: str | int, instance: int = 0, *values: float) -> None:
        """Inject a failure into the plant, like MAV_CMD_INJECT_FAILURE but not through the autopilot.

        Args:
            unit: FAILURE_UNIT by number or name: "motor", "gps", "battery".
            kind: FAILURE_TYPE by number or name: "off", "stuck", "ok".
            instance: From 1; 0 for all.
            values: Parameters 4 to 7.
        """
        numbers = (faults.number_of("FAILURE_UNIT", unit), faults.number_of("FAILURE_TYPE", kind))
        params = (*map(float, numbers), float(instance), *values)
        self._injected += self._lockstep.command_to_plant(mav.MAV_CMD_INJECT_FAILURE, *params)
        before = len(self._lockstep.acks)
        self.step()
        results = [result for number, result in self._lockstep.acks[before:] if number == mav.MAV_CMD_INJECT_FAILURE]
        if results != [mav.MAV_RESULT_ACCEPTED]:
            result = results[0] if results else mav.MAV_RESULT_FAILED
            why = self._why_not(faults.Fault(*numbers, instance), values)
            raise RefusedError(f"failure {unit} {kind}", result, why)

    def _why_not(self, fault: faults.Fault, values: Sequence[float]) -> str:
        kinds = [faults.kind_name(kind).lower() for unit, kind in faults.TABLE if unit == fault.unit]
        if not kinds:
            return f"choose one of {', '.join(dict.fromkeys(faults.short_unit_name(unit) for unit, _ in faults.TABLE))}"
        if (fault.unit, fault.kind) not in faults.TABLE:
            return f"choose one of {', '.join(kinds)}"
        if fault.unit in faults.SENSORS and self.setting.feedback is not Feedback.SENSORS:
            return f'feedback is "{self.setting.feedback}", and sensors are not used: set feedback="sensors"'
        p4, p5, p6, p7 = (*map(float, values), *(0.0,) * 4)[:4]
        judgement = faults.judged(fault._replace(values=(p4, p5, p6, p7)), tuple(faults.Equipment), self.setting.rotors)
        missing = f"the vehicle has no {faults.short_unit_name(fault.unit)}"
        return judgement.reason if isinstance(judgement, Refusal) else missing

    @property
    def wind(self) -> str:
        """The mean wind, as in mark `wind`; may be set to a constant wind."""
        return self._wind

    @wind.setter
    def wind(self, wind: str | None) -> None:
        try:
            constant = constant_wind(str(wind or CALM))
        except ArgumentTypeError as error:
            raise ValueError(f"wind {error}") from None
        self._wind = str(constant)
        self._injected += self._lockstep.change_of_world(WindChange(*constant))

    @property
    def payload_kg(self) -> float:
        """Payload, kg; may be set."""
        return self._payload_kg

    @payload_kg.setter
    def payload_kg(self, mass_kg: float) -> None:
        if not 0.0 <= mass_kg <= MAX_PAYLOAD_KG:
            raise ValueError(f"payload_kg must be from 0 to {MAX_PAYLOAD_KG:g}, not {mass_kg!r}")
        self._payload_kg = mass_kg
        self._injected += self._lockstep.change_of_world(PayloadChange(mass_kg))

    def kill_autopilot(self) -> None:
        """Kill the autopilot as SIGKILL does, and restart it with the files written so far."""
        self._lockstep.kill_autopilot()

    @property
    def inside(self) -> Inside:
        """Plant and autopilot as objects; only in memory."""
        return Inside(self._lockstep)

    # Who else is there.

    def client(self, system: int = 254, component: int = 190, *, beats: bool = True) -> Station:
        """Connect another component on its own link; `beats` sends HEARTBEAT."""
        number = len(self._stations) + 1
        trouble, seed = self.link.ground, self.setting.seed
        by_bits = not self._conventions.wire.numbers_as_floats
        who = {"system": system, "component": component}
        station = Station(self, number, **who, trouble=trouble, seed=seed, beats=beats, by_bits=by_bits)
        self._stations.append(station)
        return station


def _chosen(what: str, name: str, names: Sequence[str]) -> str:
    if name not in names:
        raise ValueError(unknown(what, name, names))
    return name
