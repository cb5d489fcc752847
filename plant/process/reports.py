"""Logs and reports of the plant's servers: silence of the autopilot, end of the flight, errors."""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from colibri.common.errors import Error
from colibri.common.process.failure_file import keep_failure
from colibri.common.process.lifecycle import EXIT_FAILED, fail, gc_frozen
from colibri.common.process.log_files import set_aside
from colibri.common.process.shared_log import SharedLog, remove_unused
from colibri.common.process.status import Status
from colibri.common.types import Array
from colibri.mavlink.links.link import GroundLink
from colibri.mavlink.ulog.blocks import Thinning
from colibri.mavlink.ulog.flight_topics import MORE_TRUTH, TRUTH, split
from colibri.mavlink.ulog.log import FileLog, TopicLog, beginning
from colibri.mavlink.ulog.reader import FILE
from colibri.mavlink.ulog.truth import TruthBlocks
from colibri.mavlink.wire.tlog import TRAFFIC, TlogWriter
from colibri.plant.physics.world import World
from colibri.plant.vehicle.description import Vehicle

MAX_WAIT_S = 0.1  # between two checks whether the process shall end
SILENT_AFTER_S = 2.0  # wall-clock silence that is reported
_COLUMNS = len(TRUTH.names)


def all_parameters_by(vehicle: str, whom: str) -> str:
    return f"all parameters: colibri vehicle {shlex.quote(vehicle)} --for {whom}"


@contextmanager
def closing(*opened: "GroundLink | PlantLogs | None", out: Path | None = None) -> Iterator[None]:
    """Fly without garbage collection, then close `opened`; an error ends the process with one line."""
    try:
        with gc_frozen():
            yield
    except Error as error:
        fail(keep_failure(error, out), EXIT_FAILED)
    finally:
        for each in opened:
            if each:
                each.close()


class Silence:
    """Reports once that an autopilot is silent, and once that it is back."""

    def __init__(self, status: Status, allowed_s: float, back: str, began_s: float) -> None:
        self._status, self._allowed_s, self._back = status, allowed_s, back
        self._since_s, self._reported = began_s, False

    def end(self, now_s: float) -> None:
        if self._reported:
            self._status.say("answered", self._back)
        self._since_s, self._reported = now_s, False

    def lasts(self, now_s: float, missing: str, time_us: int, waiting: str) -> bool:
        if self._reported or now_s - self._since_s < self._allowed_s:
            return False
        self._reported = True
        self._status.say("silence", f"{missing} at t = {time_us / 1e6:.3f} s{waiting}")
        return True


def report_end(
    status: Status,
    time_us: int,
    began_s: float,
    text: str,
    *,
    event: str = "ended",
    ended_s: float | None = None,
    **figures: Any,
) -> None:
    time_s = time_us / 1e6
    wall_time_s = (perf_counter() if ended_s is None else ended_s) - began_s
    status.say(event, text.format(f"at t = {time_s:.3f} s"), sim_time_s=time_s, wall_time_s=wall_time_s, **figures)


class TruthLog:
    """Writes the truth, also as PX4's topics where these are recorded."""

    def __init__(self, log: TopicLog, vehicle: Vehicle) -> None:
        capacity_ah = 0.0 if vehicle.battery is None else vehicle.battery.capacity_ah
        self._log = log
        self._blocks, self._thinning = None, Thinning()
        if log.for_viewers:
            self._blocks = TruthBlocks(vehicle.rad_s_per_speed_unit, capacity_ah, vehicle.rotors.count)

    def write_world(self, world: World) -> None:
        speeds, others = split(world.rotor_speeds)
        known = (*world.state, *speeds, world.voltage_v, world.charge_used_ah, *world.wind_enu_m_s, *others)
        self.write(np.array([(world.time_us, *known)]), world.time_us)

    def write(self, rows: Array, until_us: int) -> None:
        """Write rows of `physics.frames`, the last of them of `until_us`."""
        log = self._log
        if rows.shape[1] > _COLUMNS:
            log.extend(TRUTH, rows[:, :_COLUMNS])
            log.extend(MORE_TRUTH, np.concatenate([rows[:, :1], rows[:, _COLUMNS:]], axis=1))
        else:
            log.extend(TRUTH, rows)
        if self._blocks is not None and until_us >= self._thinning.next_us:
            for row, time_us in enumerate(rows[:, 0].tolist()):
                if self._thinning.is_due(time_us):
                    log.extend(self._blocks, rows[row : row + 1])


class PlantLogs:
    """The plant's files: `flight.ulg`, shared with the autopilot, and on request `flight.tlog`."""

    def __init__(self, folder: Path, vehicle: Vehicle, boot_unix_us: int = 0, *, tlog: bool = False) -> None:
        self._folder, self._vehicle, self._boot_unix_us, self.has_tlog = folder, vehicle, boot_unix_us, tlog
        self._open()

    def _open(self) -> None:
        path = self._folder / FILE
        remove_unused(path)
        remove_unused(self._folder / TRAFFIC)
        self._log = FileLog(partial(SharedLog, path, beginning(self._vehicle.name, {}), goes_on=True))
        self._truth = TruthLog(self._log, self._vehicle)
        self._tlog = TlogWriter(self._folder / TRAFFIC, shared=True) if self.has_tlog else None

    def begin_again(self) -> None:
        """Rename the files to `flight-1.ulg`, `flight-1.tlog` and so on, and begin others."""
        self.flush()
        self.close()
        set_aside(*(self._folder / name for name in (FILE, TRAFFIC)))
        self._open()

    def write_world(self, world: World) -> None:
        self._truth.write_world(world)

    def write_truth(self, rows: Array, until_us: int) -> None:
        self._truth.write(rows, until_us)

    def write_frames(self, time_us: int, frames: list[bytes]) -> None:
        if self._tlog:
            self._tlog.write(self._boot_unix_us + time_us, frames)

    def flush(self) -> None:
        self._log.flush()
        if self._tlog:
            self._tlog.flush()

    def close(self) -> None:
        self._log.close()
        if self._tlog:
            self._tlog.close()
