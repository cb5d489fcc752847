"""Plant and autopilot in memory, as objects."""

from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.copter import Copter
from colibri.plant.physics.world import World
from colibri.plant.simulation.plant import Plant
from colibri.sitl.backends.lockstep import LockstepSession
from colibri.sitl.backends.memory import MemoryAutopilot, MemoryPlant
from colibri.sitl.errors import SitlError


class Inside:
    """Plant and autopilot, for tests of internal state; only in memory."""

    def __init__(self, session: LockstepSession) -> None:
        plant, autopilot = session.plant, session.autopilot
        if not (isinstance(plant, MemoryPlant) and isinstance(autopilot, MemoryAutopilot)):
            raise SitlError("nothing can be seen inside another process: fly with --sitl-link memory")
        assert plant.plant is not None, "it has sent a frame"
        self._session = session
        self._side = autopilot
        self.plant: Plant = plant.plant

    @property
    def autopilot(self) -> Autopilot[Copter]:
        """The autopilot; a new one after a restart."""
        return self._side.autopilot

    @property
    def copter(self) -> Copter:
        return self._side.autopilot.stages

    @property
    def world(self) -> World:
        return self.plant.world

    @world.setter
    def world(self, world: World) -> None:
        self.plant.world = world
        self._measure_again()

    def skip(self, frames: int) -> None:
        """Run the plant alone for some frames, with the last command."""
        for _ in range(frames):
            self.plant.go_on()
        self._measure_again()

    def _measure_again(self) -> None:
        self._side.connect()
        self._session.measure_again()
