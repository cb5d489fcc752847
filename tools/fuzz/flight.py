"""A vehicle and its clients in one process, without files."""

from typing import Any

from msgspec import structs

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.copter import Copter, copter_autopilot
from colibri.autopilot.ground.stations import StationSettings
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.types import Vector
from colibri.flights.flight import Direct, SteppedFlight
from colibri.mavlink.files.tree import Files
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.wire.dialect import mav
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import starting_world
from colibri.plant.simulation.plant import PlantBuilder
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import load_vehicle
from colibri.sitl.stepping import Steered, Stepped
from tools.harness.client import COMPONENT, SYSTEM, HarnessClient

STANDING = Start()
"""On its feet: z counts from where the vehicle stands."""
ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
_AS_IT_IS = load_profile("flight")
_PROFILE = structs.replace(_AS_IT_IS, simulation=structs.replace(_AS_IT_IS.simulation, frame_interval_s=None))
"""No frames between control samples: a third less to compute."""


class BareFlight(Stepped, Steered):
    system = SYSTEM

    def __init__(self, files: Files | None = None) -> None:
        self._vehicle = load_vehicle(_PROFILE.simulation.vehicle)
        self._settings = StationSettings(system_id=SYSTEM, identity="px4", origin=DEFAULT_ORIGIN, files=files)
        self.client = HarnessClient()
        self._clients: list[HarnessClient] = []
        autopilot = self._new_autopilot()
        builder = PlantBuilder(WorldSpec(), self._vehicle, {Feedback.STATE: STANDING}, origin=DEFAULT_ORIGIN)
        self.plant = builder.build(Feedback.STATE, autopilot.frame_interval_us)
        self._flight = SteppedFlight(self.plant, autopilot, Direct())
        self.rotors = ActuatorCommand(0, (0.0, 0.0, 0.0, 0.0), armed=False)
        self.add(self.client)
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

    def add(self, client: HarnessClient) -> HarnessClient:
        self._clients.append(client)
        self.copter.stations.hub.open(client.link, client.address)
        return client

    def restart(self) -> None:
        self._flight = SteppedFlight(self.plant, self._new_autopilot(), Direct())
        for client in self._clients:
            self.copter.stations.hub.open(client.link, client.address)

    def _new_autopilot(self) -> Autopilot[Copter]:
        return copter_autopilot(_PROFILE, self._vehicle, self._settings, lambda: 0.0, strict=True)

    def reset_world(self, start: Start) -> None:
        self.plant.world = starting_world(start, self._vehicle)._replace(time_us=self.time_us)

    def step(self) -> None:
        sample = self._flight.step([received for client in self._clients for received in client.take_sent()])
        self.rotors = sample.command
        for link, address, datagram in sample.to_stations:
            for client in self._clients:
                if (client.link, client.address) == (link, address):
                    client.receive(datagram)

    def send(self, name: str, *fields: Any) -> None:
        self.client.send(name, *fields)

    def command(self, number: int, *params: float) -> int:
        """Send a COMMAND_LONG; return the MAV_RESULT. Missing parameters are 0."""
        before = len(self.client.acks)
        values = (*params, *(0.0,) * (7 - len(params)))
        self.send("COMMAND_LONG", SYSTEM, COMPONENT, number, 0, *values)
        self.wait_until(lambda: len(self.client.acks) > before, within=0.1, what=f"COMMAND_ACK of {number}")
        self.step()
        (ack,) = self.client.acks[before:]
        return int(ack.result)
