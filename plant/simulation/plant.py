"""The plant as a pure composition: a world that is told of frame by frame, and goes on with each answer."""

from collections.abc import Sequence

from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.plant_status import FaultResult, PlantStatus, ReceivedFrame
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.physics.world import Physics, World
from colibri.plant.sensors.suite import tells
from colibri.plant.simulation.command_delay import Actuation
from colibri.plant.simulation.faults import Faults
from colibri.plant.vehicle.description import Vehicle


class Plant:
    """One vehicle in its world.

    Attributes:
        world: As it is now.
        faults: What has gone wrong.
        interval_us: Between two frames.
    """

    def __init__(
        self,
        world: World,
        vehicle: Vehicle,
        physics: Physics,
        feedback: Feedback,
        origin: Geodetic,
        *,
        seed: int,
        interval_us: int,
        latency_us: int = 0,
    ) -> None:
        """Begin with `world`.

        Args:
            world: Now.
            vehicle: That flies in it.
            physics: Its laws.
            feedback: What is told of it.
            origin: Of the ENU frame.
            seed: Of everything random.
            interval_us: Between two frames.
            latency_us: From the plant to the autopilot, and as much back: the command that answers a frame acts from
                twice that later on.
        """
        self.world = world
        self.faults = Faults(vehicle, physics, feedback, seed=seed)
        self.interval_us = interval_us
        self._physics = physics
        self._tell = tells(
            feedback, vehicle, physics, origin, seed=seed, interval_us=interval_us, faults=self.faults.sensors
        )
        self._actuation = Actuation(_held(world, vehicle))
        self._round_trip_us = 2 * latency_us
        self._results: tuple[FaultResult, ...] = ()

    def tell(self) -> ReceivedFrame:
        """Return the frame of the world as it is now, and what goes beside it."""
        return ReceivedFrame(self._tell(self.world), PlantStatus(self._physics.battery(self.world), self._results))

    def answer(self, command: ActuatorCommand, faults: Sequence[Fault] = ()) -> None:
        """Go on to the next frame, with the answer to this one and with faults that happen now."""
        self.inject(faults)
        self.arrive(self.world.time_us, command)
        self.go_on()

    def inject(self, faults: Sequence[Fault]) -> None:
        """Have faults happen now; the next frame is told what became of them."""
        self.world, self._results = self.faults.inject_all(faults, self.world)

    def arrive(self, sent_us: int, command: ActuatorCommand) -> None:
        """Take a command that is on its way since `sent_us`."""
        self._actuation.arrive(sent_us + self._round_trip_us, command)

    def go_on(self) -> None:
        """Advance to the next frame.

        Raises:
            IntegrationError: The state cannot be integrated any further.
        """
        begin_us = self.world.time_us
        for command, duration_us in self._actuation.spans(begin_us, begin_us + self.interval_us):
            self.world = self._physics.step(self.world, command, duration_us)


def _held(world: World, vehicle: Vehicle) -> ActuatorCommand:
    """Return the command that keeps the rotors as they are."""
    a, b, c, d = (speed / vehicle.rotors.max_speed for speed in world.rotor_speeds)
    return ActuatorCommand(world.time_us, (a, b, c, d), armed=any(world.rotor_speeds))
