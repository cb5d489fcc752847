"""The plant's own logs of a flight."""

from pathlib import Path

from colibri.common.process.log_files import CsvLog, set_aside
from colibri.mavlink.hil.lockstep_plant import Outgoing
from colibri.mavlink.wire.tlog import TlogWriter
from colibri.plant.physics.equations import STATE
from colibri.plant.physics.world import World
from colibri.plant.process.truth_topics import NAME, TruthTopics
from colibri.plant.vehicle.description import Vehicle

TRUTH, TRAFFIC = "plant.csv", "flight.tlog"
WIND_COLUMNS = ("wind_east", "wind_north", "wind_up")
TRUTH_COLUMNS = ("t", *STATE, "omega1", "omega2", "omega3", "omega4", "voltage_v", "charge_ah", *WIND_COLUMNS)


def truth_row(world: World) -> tuple[float, ...]:
    """Return what `TRUTH_COLUMNS` names; `nan` volts where there is no battery."""
    battery = (world.voltage_v, world.charge_used_ah)
    return (world.time_us / 1e6, *world.state, *world.rotor_speeds, *battery, *world.wind_enu_m_s)


class PlantLogs:
    """What the plant writes: the truth at every frame, also as topics, and every MAVLink frame."""

    def __init__(
        self, folder: Path, vehicle: Vehicle, boot_unix_us: int = 0, *, speaks_mavlink: bool = True, ulog: bool = True
    ) -> None:
        """Create `plant.csv` in `folder`, and `flight.tlog` where the plant `speaks_mavlink`.

        With `ulog` there is `flight.ulg`, too. `boot_unix_us` is the Unix time at simulated time 0; without it times
        of `flight.tlog` are simulated.
        """
        self._vehicle, self._has_topics = vehicle, ulog
        self._boot_unix_us = boot_unix_us
        self._speaks_mavlink = speaks_mavlink
        self._folder = folder
        self._open()

    def _open(self) -> None:
        self._truth = CsvLog(self._folder / TRUTH, TRUTH_COLUMNS)
        self._tlog = TlogWriter(self._folder / TRAFFIC) if self._speaks_mavlink else None
        self._topics = TruthTopics(self._folder, self._vehicle) if self._has_topics else None

    def begin_again(self) -> None:
        """Begin the files of another flight; those of the last one become `plant-1.csv`, `flight-1.tlog`, and so on.

        Raises:
            LogError: The last one's cannot be written or renamed.
        """
        self.flush()
        self.close()
        set_aside(*(self._folder / name for name in (TRUTH, TRAFFIC, NAME)))
        self._open()

    def write_world(self, world: World) -> None:
        """Append the truth."""
        row = truth_row(world)
        self._truth.add(row)
        if self._topics:
            self._topics.add(row)

    def write_traffic(self, time_us: int, received: list[bytes], sent: list[Outgoing]) -> None:
        """Append what was received and sent at simulated time `time_us`."""
        for outgoing in sent:
            received = [*received, *outgoing.frames]
        self.write_frames(time_us, received)

    def write_frames(self, time_us: int, frames: list[bytes]) -> None:
        """Append frames of simulated time `time_us`."""
        if self._tlog:
            self._tlog.write(self._boot_unix_us + time_us, frames)

    def flush(self) -> None:
        """Write what waits.

        Raises:
            LogError: It cannot be written.
        """
        self._truth.flush()
        if self._tlog:
            self._tlog.flush()
        if self._topics:
            self._topics.flush()

    def close(self) -> None:
        """Close all."""
        if self._topics:
            self._topics.close()
        self._truth.close()
        if self._tlog:
            self._tlog.close()
