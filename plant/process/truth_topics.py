"""`flight.ulg` as the plant writes it: the truth as topics, beside the autopilot, which writes to the same file."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from colibri.common.process.log_files import LogError
from colibri.common.process.shared_log import SharedLog, remove_unused
from colibri.mavlink.ulog.beginning import beginning
from colibri.mavlink.ulog.truth import TruthBlocks, TruthVehicle
from colibri.plant.vehicle.description import Vehicle

NAME = "flight.ulg"


class TruthTopics:
    """Writes rows of `plant.csv` as topics. The file is opened with the first block: the autopilot begins it."""

    def __init__(self, folder: Path, vehicle: Vehicle) -> None:
        """Write to `flight.ulg` in `folder`; that of an earlier flight is removed."""
        capacity_ah = 0.0 if vehicle.battery is None else vehicle.battery.capacity_ah
        self._path, self._name = folder / NAME, vehicle.name
        self._blocks = TruthBlocks(TruthVehicle(vehicle.rad_s_per_speed_unit, capacity_ah))
        self._file: SharedLog | None = None
        remove_unused(self._path)

    def add(self, row: Sequence[float]) -> None:
        """Append a row.

        Raises:
            LogError: It cannot be written.
        """
        self._append(self._blocks.add(row))

    def flush(self) -> None:
        """Write what waits.

        Raises:
            LogError: It cannot be written.
        """
        self._append(self._blocks.take())

    def close(self) -> None:
        """Write what waits, if that can be done, and close."""
        with suppress(LogError):
            self.flush()
        if self._file is not None:
            self._file.close()

    def _append(self, block: bytes) -> None:
        if not block:
            return
        if self._file is None:
            self._file = SharedLog(self._path, beginning(self._name, {}), goes_on=True)
        self._file.append(block)
