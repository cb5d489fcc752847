"""A whole vehicle in one process: plant and autopilot in lockstep on simulated time, flown by clients over MAVLink.

Nothing is simulated of the links but the bytes.
"""

from collections.abc import Callable
from math import nan
from typing import Any

import pytest
from msgspec import structs

from colibri.autopilot.commander.rules.modes import Mode, custom_mode, mode_of_custom
from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.checkpoint import Checkpoint, History
from colibri.autopilot.core.copter import Copter, copter_autopilot
from colibri.autopilot.estimation.estimate import Estimate
from colibri.autopilot.ground.stations import StationSettings
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, geodetic_of
from colibri.common.rotations import euler_from_quaternion
from colibri.common.serialization import of_bytes, to_bytes
from colibri.common.types import Vector
from colibri.mavlink.files.tree import Files
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.parameters.store import Value
from colibri.mavlink.services.command import NOT_GIVEN
from colibri.mavlink.wire.dialect import mav
from colibri.plant.environment.air import CALM
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import World, starting_world, state_frame
from colibri.plant.process.start import nudged
from colibri.plant.simulation.plant import PlantBuilder
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import Vehicle, load_vehicle
from colibri.sitl.stepping import Steered, Stepped
from colibri.sitl.vehicle import FORCE
from tools.harness.client import COMPONENT, SYSTEM, Client
from tools.harness.plant_flights import blowing

STANDING = Start()
"""On its feet: z counts from where the vehicle stands."""
NO_CLOCK_S = 0.0
ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
DENIED: int = mav.MAV_RESULT_DENIED
_AS_IT_IS = load_profile("flight")
FLIGHT = structs.replace(_AS_IT_IS, simulation=structs.replace(_AS_IT_IS.simulation, frame_interval_s=None))
"""The flight profile with a frame for each control sample and none between: a third less to compute."""


def in_the_air(height_m: float = 5.0, **settings: Any) -> "CopterFlight":
    """Return a vehicle that is picked up in flight, in hold above home, without having had to take off."""
    start = Start(z=height_m, psi=90.0, rotors=FLIGHT.simulation.rotor_speed_rpm)
    flight = CopterFlight(start=start, **settings)
    assert flight.copter.pilot.state == (Mode.HOLD, True)
    return flight


class CopterFlight(Stepped, Steered):
    """A vehicle and its surroundings, with the vocabulary of fixture `sitl`; commands return the MAV_RESULT.

    Attributes:
        system: The vehicle's system id.
        autopilot: The autopilot.
        plant: The plant.
        client: The first ground station.
        rotors: The last command to the plant.
        estimate: The last state estimate; None where the plant sends the true state.
    """

    system = SYSTEM

    def __init__(
        self,
        *,
        start: Start = STANDING,
        values: dict[str, Value] | None = None,
        profile: Profile | None = None,
        vehicle: Vehicle | None = None,
        wind_enu_m_s: Vector = CALM,
        first: Track | None = None,
        origin: Geodetic = DEFAULT_ORIGIN,
        client: Client | None = None,
        files: Files | None = None,
        feedback: Feedback = Feedback.STATE,
        seed: int = 0,
        latency_us: int = 0,
        strict: bool = True,
    ) -> None:
        """Begin at `start`, with parameters `values`; `vehicle` is the plant's, where it is not the autopilot's.

        On sensors it stands until there is an estimate. Unless `strict`, what raises in flight is replaced.
        """
        self._strict = strict
        self._profile = profile or FLIGHT
        self._assumed = load_vehicle(self._profile.simulation.vehicle)
        self._settings = StationSettings(
            system_id=SYSTEM, identity="px4", origin=origin, files=files, feedback=feedback
        )
        self._weather = blowing(wind_enu_m_s)
        self.autopilot = self._copter(values, first)
        world = WorldSpec(wind=self._weather.wind, seed=seed, latency=latency_us * 1e-3)
        builder = PlantBuilder(world, vehicle or self._assumed, {feedback: nudged(start)}, origin=origin)
        self.plant = builder.build(feedback, self.autopilot.frame_interval_us)
        self.rotors = ActuatorCommand(0, (0.0, 0.0, 0.0, 0.0), armed=False)
        self.estimate: Estimate | None = None
        self.client = client or Client()
        self._clients: list[Client] = []
        self.add(self.client)
        self.step()
        if feedback is Feedback.SENSORS:
            self.wait_until(lambda: self.estimate is not None, within=10.0, what="the first estimate")
        self.step()

    @property
    def copter(self) -> Copter:
        """The vehicle that ground stations fly."""
        return self.autopilot.stages

    def history(self) -> History:
        """Return what is kept of the flight, as it comes from a disk."""
        kept = of_bytes(Checkpoint, to_bytes(self.copter.record()))
        assert kept is not None
        plans = self.copter.stations.plans.plans
        return History(kept, {plan_type: plan.items for plan_type, plan in plans.items()})

    def _copter(
        self, values: dict[str, Value] | None, first: Track | None, history: History | None = None
    ) -> Autopilot[Copter]:
        return copter_autopilot(
            self._profile,
            self._assumed,
            self._settings,
            lambda: NO_CLOCK_S,
            values=values,
            first=first,
            history=history,
            strict=self._strict,
        )

    def add(self, client: Client) -> Client:
        """Connect another client."""
        self._clients.append(client)
        self.copter.stations.hub.open(client.link, client.address)
        return client

    def reset_world(self, start: Start) -> None:
        """Reset the plant to `start` at this time."""
        self.world = starting_world(start, self._assumed, self._weather)._replace(time_us=self.world.time_us)

    def restart(self, history: History | None = None) -> None:
        """Start the autopilot again, wherever the vehicle is; with the history of a flight it flies on at once."""
        values = None if history is None else dict(self.copter.parameters.values)
        self.autopilot = self._copter(values, None, history)
        for client in self._clients:
            self.copter.stations.hub.open(client.link, client.address)
        if history is not None:
            self.step()

    def step(self) -> None:
        """Fly one frame."""
        step = self.autopilot.step(*self.plant.measure())
        self.rotors, self.estimate = step.command, step.estimate or self.estimate
        self.plant.answer(step.command, step.faults)
        inbox = [received for client in self._clients for received in client.take_sent()]
        for link, address, datagram in self.autopilot.serve(inbox):
            for client in self._clients:
                if (client.link, client.address) == (link, address):
                    client.receive(datagram)

    def skip(self, frames: int) -> None:
        """Have the plant go on by itself for some frames, with the last command."""
        for _ in range(frames):
            self.plant.go_on()

    def path(self, seconds: float) -> list[Vector]:
        """Fly for so long; return where it was at each frame."""
        end_us = self.world.time_us + round(seconds * 1e6)
        return self.path_until(lambda: self.world.time_us >= end_us, seconds + 1.0)

    def path_until(self, condition: Callable[[], object], max_s: float) -> list[Vector]:
        """Fly until `condition()`; return where it was at each frame."""
        path = [self.position]

        def note_and_ask() -> object:
            path.append(self.position)
            return condition()

        self.wait_until(note_and_ask, within=max_s)
        return path

    def send(self, name: str, *fields: Any) -> None:
        """Send a message from the first client."""
        self.client.send(name, *fields)

    def command(self, number: int, *params: float, client: Client | None = None, confirmation: int = 0) -> int:
        """Send a COMMAND_LONG and return the MAV_RESULT; parameters that are left out are 0."""
        who = client or self.client
        values = (*params, *(0.0,) * (7 - len(params)))
        who.send("COMMAND_LONG", SYSTEM, COMPONENT, number, confirmation, *values)
        return self._result(number, who)

    def command_int(
        self, number: int, *params: float, frame: int, x: int = NOT_GIVEN, y: int = NOT_GIVEN, z: float = nan
    ) -> int:
        """Send a COMMAND_INT and return the MAV_RESULT; x, y, z that are left out are not given."""
        values = (*params, *(0.0,) * (4 - len(params)))
        self.client.send("COMMAND_INT", SYSTEM, COMPONENT, frame, number, 0, 0, *values, x, y, z)
        return self._result(number, self.client)

    def _result(self, number: int, who: Client) -> int:
        before = len(who.acks)
        self.wait_until(lambda: len(who.acks) > before, within=0.1, what=f"COMMAND_ACK of {number}")
        self.step()
        (ack,) = who.acks[before:]
        assert ack.command == number
        return int(ack.result)

    def select(self, mode: Mode) -> int:
        """Choose a mode by DO_SET_MODE; return the MAV_RESULT."""
        number = custom_mode(mode)
        return self.command(mav.MAV_CMD_DO_SET_MODE, 1.0, number >> 16 & 0xFF, number >> 24 & 0xFF)

    def arm(self, *, force: bool = False) -> int:
        """Arm, by `force` without the checks; return the MAV_RESULT."""
        return self.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, FORCE if force else 0.0)

    def disarm(self, *, force: bool = False) -> int:
        """Disarm, in the air only by force; return the MAV_RESULT."""
        return self.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, FORCE if force else 0.0)

    def drain(self, part: float) -> None:
        """Have so much of the full battery's charge gone at once, and fly one frame."""
        assert self._assumed.battery is not None
        gone_ah = part * self._assumed.battery.capacity_ah
        self.world = self.world._replace(charge_used_ah=self.world.charge_used_ah + gone_ah)
        self.step()

    def inject(self, unit: int, kind: int, instance: int = 0, *values: float) -> int:
        """Have a fault happen in the plant, without a command; return the MAV_RESULT."""
        a, b, c, d = (*values, 0.0, 0.0, 0.0, 0.0)[:4]
        self.world, ack = self.plant.faults.inject(Fault(unit, kind, instance, (a, b, c, d)), self.world)
        return ack.result

    def set_param(self, name: str, value: Value) -> None:
        """Set a parameter as a ground station does, and see that it was taken."""
        self.copter.parameters.set(name, value)
        self.step()
        assert self.copter.parameters[name] == pytest.approx(value, rel=1e-6)  # they are of 32 bits

    def takeoff(self, height_m: float = 2.5) -> None:
        """Arm, climb above home and stay."""
        assert self.command(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, height_m) == ACCEPTED
        assert self.arm() == ACCEPTED
        self.wait_until(lambda: self.mode is Mode.HOLD, within=5.0 + 2.0 * height_m, what="take-off")
        self.run(1.0)

    def land(self) -> None:
        """Land where it is, and wait until the rotors have stopped."""
        assert self.select(Mode.LAND) == ACCEPTED
        self.wait_until(lambda: not self.armed, within=5.0 + 2.0 * self.position[2], what="landing")

    def goto(self, east: float, north: float, up: float, *, speed: float = -1.0) -> int:
        """Reposition to a place, ENU from the origin, m and m/s; return the MAV_RESULT."""
        there = geodetic_of((east, north, up), self._settings.origin)
        x, y = round(there.latitude_deg * 1e7), round(there.longitude_deg * 1e7)
        frame = mav.MAV_FRAME_GLOBAL
        return self.command_int(
            mav.MAV_CMD_DO_REPOSITION, speed, 1.0, 0.0, nan, frame=frame, x=x, y=y, z=there.altitude_m
        )

    @property
    def time_us(self) -> int:
        """Simulated time, µs."""
        return self.world.time_us

    @property
    def world(self) -> World:
        """The plant's world."""
        return self.plant.world

    @world.setter
    def world(self, world: World) -> None:
        self.plant.world = world

    @property
    def mode(self) -> Mode:
        """The flight mode."""
        return self.copter.pilot.state.mode

    @property
    def armed(self) -> bool:
        """Whether the rotors may turn."""
        return self.copter.pilot.state.armed

    @property
    def reported_mode(self) -> Mode | None:
        """The flight mode of the last HEARTBEAT."""
        return mode_of_custom(self.client.latest("HEARTBEAT").custom_mode)

    @property
    def position(self) -> Vector:
        """Of the plant, m, ENU."""
        x, y, z = self.world.state[6:9]
        return (x, y, z)

    @property
    def velocity(self) -> Vector:
        """Of the plant, m/s, ENU."""
        return state_frame(self.world).velocity_enu_m_s

    @property
    def yaw_rad(self) -> float:
        """Of the plant, counter-clockwise from east."""
        return self.euler[2]

    @property
    def euler(self) -> Vector:
        """Roll, pitch, yaw of the plant, rad."""
        return euler_from_quaternion(state_frame(self.world).attitude)
