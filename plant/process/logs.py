"""The plant's own logs of a flight."""

from pathlib import Path

from colibri.common.process.log_files import CsvLog
from colibri.mavlink.hil.lockstep_plant import Outgoing
from colibri.mavlink.wire.tlog import TlogWriter
from colibri.plant.physics.equations import STATE
from colibri.plant.physics.world import World

WIND_COLUMNS = ("wind_east", "wind_north", "wind_up")
TRUTH_COLUMNS = ("t", *STATE, "omega1", "omega2", "omega3", "omega4", "voltage_v", "charge_ah", *WIND_COLUMNS)


def truth_row(world: World) -> tuple[float, ...]:
    """Return what `TRUTH_COLUMNS` names; `nan` volts where there is no battery."""
    battery = (world.voltage_v, world.charge_used_ah)
    return (world.time_us / 1e6, *world.state, *world.rotor_speeds, *battery, *world.wind_enu_m_s)


class PlantLogs:
    """What the plant writes: the truth at every frame, and every MAVLink frame."""

    def __init__(self, folder: Path, boot_unix_us: int = 0) -> None:
        """Create `plant.csv` and `flight.tlog` in `folder`; `boot_unix_us`: Unix time at simulated time 0.

        Without it the times of `flight.tlog` are simulated.
        """
        self._boot_unix_us = boot_unix_us
        self._truth = CsvLog(folder / "plant.csv", TRUTH_COLUMNS)
        self._tlog = TlogWriter(folder / "flight.tlog")

    def write_world(self, world: World) -> None:
        """Append the truth."""
        self._truth.add(truth_row(world))

    def write_traffic(self, time_us: int, received: list[bytes], sent: list[Outgoing]) -> None:
        """Append what was received and sent at simulated time `time_us`."""
        for outgoing in sent:
            received = [*received, *outgoing.frames]
        self.write_frames(time_us, received)

    def write_frames(self, time_us: int, frames: list[bytes]) -> None:
        """Append frames of simulated time `time_us`."""
        self._tlog.write(self._boot_unix_us + time_us, frames)

    def flush(self) -> None:
        """Write what waits.

        Raises:
            LogError: It cannot be written.
        """
        self._truth.flush()
        self._tlog.flush()

    def close(self) -> None:
        """Close both."""
        self._truth.close()
        self._tlog.close()
